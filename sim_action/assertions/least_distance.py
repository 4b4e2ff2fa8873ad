"""How near the robot came to bodies, folded over traces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_action.channels import ClearanceWatch
from sim_action.clearance_record import Nearness

if TYPE_CHECKING:
    from sim_action.trace import Trace


def nearest_of(trace: Trace, watch: ClearanceWatch | None, before: Nearness | None) -> Nearness | None:
    """The first least distance of what a watch tells of these moments and what was known before; None if nothing is."""
    record = None if watch is None else trace.clearances.get(watch)
    if record is None or not len(record):
        return before
    nearest = record.at(int(record.distance.argmin()))
    return nearest if before is None or nearest.distance < before.distance else before
