"""Recordings of a run: the replay that a report shows, and exports in formats of other tools."""
