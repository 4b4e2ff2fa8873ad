"""Replays: the recording of a run that `report.html` shows, stored next to the trace."""
