"""What is wrong with joints and lengths that are stated of wheels, whatever the drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sim_action.core import units
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive
from sim_action.robot.robot_model import RobotModel

LEAST_LENGTH: Final = 1e-6
"""In m. Wheels of less would be asked to turn at speeds that are no numbers."""

_MOST_LENGTH: Final = 1e3

# In rad, from one limit to the other: exporters write such as 1e9 for what turns for ever.
_FOR_EVER: Final = 1e5


def why_no_wheel(model: RobotModel, name: str) -> str | None:
    """What to say of a joint that no wheel turns about: engines drive it through its limits, for a while."""
    if (trouble := model.why_not_driven(name)) is not None:
        return trouble
    joint = model.joints_by_name[name]
    if joint.type == "prismatic":
        return f"joint '{name}' slides: a wheel turns about a joint that is 'continuous'"
    if joint.lower is None or joint.upper is None or not 0 <= joint.upper - joint.lower < _FOR_EVER:
        return None
    limits = f"{units.display(joint.lower, 'rad')} to {units.display(joint.upper, 'rad')}"
    return f"joint '{name}' has limits, {limits}: a wheel turns for ever, about a joint that is 'continuous'"


def joint_problems(model: RobotModel, key: str, names: Sequence[str]) -> SpecProblems:
    """Joints that cannot turn a wheel, each at its place below the drive's key."""
    for index, name in enumerate(names):
        if (trouble := why_no_wheel(model, name)) is not None:
            yield (key, index), trouble


def length_problems(drive: Drive, *keys: str) -> SpecProblems:
    """Lengths of a drive that are stated, and that nothing has."""
    for key in keys:
        length = getattr(drive, key) or 0
        if 0 < length < LEAST_LENGTH:
            yield (key,), f"must be at least {LEAST_LENGTH:g} m"
        elif length > _MOST_LENGTH:
            yield (key,), f"must be at most {_MOST_LENGTH:g} m"
