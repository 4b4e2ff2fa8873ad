"""Replays: what a page shows of a run, made in the scenario's own process and stored beside its trace.

`models` says what is in the file. Nothing in one is trusted when it is read.
"""

from sim_action.recording.replay.models import Replay

__all__ = ["Replay"]
