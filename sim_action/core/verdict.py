"""The judgement on one assertion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was measured against what was asked.

    Attributes:
        passed: whether the assertion held.
        measured: the value that decided it, in `unit`; None if nothing was there to measure.
        limit: what it was held against, in `unit`.
        margin: distance to the limit, in `unit`; positive on the good side.
        unit: SI symbol, empty for a count.
        time: sim time in s at which it was decided, or at which an invariant came nearest to its limit.
        message: one sentence for people.
        cut_off: whether it failed as something else ended the run before it was decided: not the reason to look for.
        goal: whether it had to come true once; its margin is that of the moment it did, and says little.
    """

    passed: bool
    measured: float | None = None
    limit: float | None = None
    margin: float | None = None
    unit: str = ""
    time: float | None = None
    message: str = ""
    cut_off: bool = False
    goal: bool = False
