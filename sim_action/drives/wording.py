"""Figures of drives in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from sim_action.core import units
from sim_action.robot.robot_model import RobotModel

# In degrees: a file's digits of pi are off by less.
_PLAIN: Final = 0.05


def heading_text(heading: float) -> str:
    """What to say of a heading; nothing of one along the base's x axis."""
    degrees = math.degrees(heading)
    return f", heading {degrees:.4g} deg from the base's x axis" if abs(degrees) >= _PLAIN else ""


def radius_text(radii: Sequence[float]) -> str:
    """The radius of wheels in words, or their radii."""
    told = dict.fromkeys(f"{radius:.4g} m" for radius in radii)
    return f"wheel {'radius' if len(told) == 1 else 'radii'} {', '.join(told)}"


def torque_text(torque: float | None, model: RobotModel, names: Sequence[str]) -> str:
    """The limit of the motors of wheels in words; nothing without one."""
    limits = [torque] if torque is not None else [model.joints_by_name[name].max_effort for name in names]
    told = dict.fromkeys(units.display(limit, "N m") for limit in limits if limit)
    return f", torque {' and '.join(told)}" if told else ""


def remarked(figures: str, remarks: Sequence[str]) -> str:
    """A drive in words, with what has to be told of how a plugin's words were taken."""
    return "; ".join((figures, *remarks))
