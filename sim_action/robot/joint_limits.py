"""What a joint cannot do: be beyond its limits, move faster than it can, push harder than its motor can."""

from __future__ import annotations

import math
from typing import Final

from sim_action.core import units
from sim_action.robot.robot_model import Joint, Reading

# Models state limits such as 1.5707963, scenarios 90 deg; in rad, or m.
_POSITION_ROUNDING: Final = 1e-6
# The same, as a share of a limit of speed or effort.
_SHARE_ROUNDING: Final = 1e-6


def beyond_limits(joint: Joint, position: float) -> str | None:
    """Says so if a joint cannot be at a position in rad (m); limits that are the wrong way round limit nothing."""
    lower = -float("inf") if joint.lower is None else joint.lower
    upper = float("inf") if joint.upper is None else joint.upper
    if lower > upper or lower - _POSITION_ROUNDING <= position <= upper + _POSITION_ROUNDING:
        return None
    unit = joint.dimension("position").si
    at, passed = units.display_apart(position, lower if position < lower else upper, unit)
    low, high = (passed, units.display(upper, unit)) if position < lower else (units.display(lower, unit), passed)
    bounds = f"{low} or more" if math.isinf(upper) else f"{high} or less" if math.isinf(lower) else f"{low} to {high}"
    return f"{at} is outside the limits of the joint, {bounds}"


def too_fast(joint: Joint, speed: float) -> str | None:
    """Says so if a joint cannot move at a speed in rad/s (m/s), whichever way."""
    return _too_much(joint, "velocity", speed, joint.max_velocity)


def too_strong(joint: Joint, effort: float) -> str | None:
    """Says so if a joint's motor cannot exert an effort in N m (N), whichever way."""
    return _too_much(joint, "effort", effort, joint.max_effort)


def _too_much(joint: Joint, reading: Reading, value: float, limit: float | None) -> str | None:
    if limit is None or abs(value) <= limit * (1 + _SHARE_ROUNDING):
        return None
    found, most = units.display_apart(abs(value), limit, joint.dimension(reading).si)
    return f"{found} is more than the joint's {reading} limit, {most}"
