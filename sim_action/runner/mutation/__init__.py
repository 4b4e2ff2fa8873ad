"""Mutation of scenarios: runs with a fault of the system on purpose show which expectations notice anything."""
