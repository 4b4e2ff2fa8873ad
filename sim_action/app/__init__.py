"""One module for each use case: run, validate, compare, merge, matrix, view, inspect."""
