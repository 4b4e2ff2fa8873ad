"""The scripts of the actions. Those of the set-up need the standard library alone."""
