"""Mutation of scenarios: runs with injected faults show which expectations notice anything."""
