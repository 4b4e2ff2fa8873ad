"""What all other folders build on: errors, units, geometry, YAML documents, the workspace and its files."""
