"""Recorded logs: the commands that a robot was once given, with their times.

A log is read as moments: pairs of a time in s since its first message and the command that was given then. Times do not
fall. What cannot be read raises RecordingError.
"""

from __future__ import annotations

from sim_action.state.command import Command

Moment = tuple[float, Command]
"""Time in s since the first message of the log, and the command that was given then."""
