"""Variations of a scenario: their keys and values, random draws, and the gate that judges the samples."""
