"""Recordings of a run: the replay for `report.html`, and exports to the formats of other tools."""
