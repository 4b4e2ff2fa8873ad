"""What tells two runs apart: a digest of all that the robot did."""

from __future__ import annotations

import hashlib

from sim_action.state.trace import Trace


class Digest:
    """SHA-256 over the state at every step, however the steps are cut into traces."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, trace: Trace) -> None:
        """Takes in the steps that follow."""
        self._hash.update(trace.state.astype("<f8", order="C", copy=False).tobytes())

    def hexdigest(self) -> str:
        """64 hexadecimal digits."""
        return self._hash.hexdigest()
