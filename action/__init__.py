"""The scripts of the actions. The set-up scripts need the standard library alone."""
