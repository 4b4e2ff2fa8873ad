"""Faults of the system in real runs: full disks, exhausted descriptors, signals. `measure` prints a table of all."""
