"""The base of all other folders: errors, units, geometry, YAML documents, the workspace and file access."""
