"""The scenario file: from YAML text to a checked, frozen `Scenario`."""
