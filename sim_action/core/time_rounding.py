"""How far apart two ways to the same moment may be, and which step a moment belongs to."""

from __future__ import annotations

import math
from typing import Final

TIME_EPSILON: Final = 1e-9
"""In s. Sim time is step / rate: two ways to the same moment differ by rounding alone."""

STEP_EPSILON: Final = 1e-6
"""Of a step: a time that is no later than this after a step is that of the step."""


def first_step(time: float, rate: float) -> int:
    """The first physics step at or after a sim time in s, at `rate` Hz."""
    return math.ceil(time * rate - STEP_EPSILON)
