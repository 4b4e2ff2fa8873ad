"""The differences between the scenes of two replays: bodies that are new, gone or elsewhere, and another robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, Final

from sim_action.core import units
from sim_action.core.wording import shortened
from sim_action.recording.replay.scene_data import BodyData, LinkData, SceneData
from sim_action.recording.replay.shapes import PoseNumbers
from sim_action.reports.escaping import one_line
from sim_action.reports.html.parting import ANGLE_RAD, POSITION_M

_MAX_NAMED: Final = 3
_MAX_NAME: Final = 40


def world_changes(ours: SceneData, theirs: SceneData) -> str:
    """Return what differs from an earlier scene in words, such as "pallet is new"; empty if nothing does."""
    return ", ".join(chain(_of_robot(ours, theirs), _of_bodies(ours.bodies, theirs.bodies)))


def _of_robot(ours: SceneData, theirs: SceneData) -> Iterator[str]:
    if ours.robot != theirs.robot:
        yield f"the robot is {_name(ours.robot)}, not {_name(theirs.robot)}"
    elif [_form(link) for link in ours.links] != [_form(link) for link in theirs.links]:
        yield "the model of the robot differs"


def _of_bodies(ours: Sequence[BodyData], theirs: Sequence[BodyData]) -> Iterator[str]:
    before, now = ({body.name: body for body in several} for several in (theirs, ours))
    both = [(before[name], body) for name, body in now.items() if name in before]
    yield from _named([name for name in now if name not in before], "is new", "are new")
    yield from _named([name for name in before if name not in now], "is gone", "are gone")
    moved = [(new, words) for old, new in both if (words := _moved(old.pose, new.pose))]
    yield from (f"{_name(body.name)} {words}" for body, words in moved[:_MAX_NAMED])
    yield from _named([body.name for body, _ in moved[_MAX_NAMED:]], "starts elsewhere", "start elsewhere")
    yield from _named(
        [new.name for old, new in both if _form(old)["shapes"] != _form(new)["shapes"]],
        "has another shape",
        "have other shapes",
    )


def _form(owner: LinkData | BodyData) -> dict[str, Any]:
    return owner.model_dump(exclude={"shapes": {"__all__": {"color", "opacity"}}})


def _named(names: Sequence[str], one: str, several: str) -> Iterator[str]:
    """Yield one part for bodies of which the same is said."""
    if not names:
        return
    shown = [_name(name) for name in names[:_MAX_NAMED]]
    left = len(names) - len(shown)
    *first, last = [*shown, *([f"{left} more"] if left else [])]
    told = f"{', '.join(first)} and {last}" if first else last
    yield f"{told} {one if len(names) == 1 else several}"


def _name(name: str) -> str:
    return shortened(one_line(name), _MAX_NAME)


def _moved(old: PoseNumbers, new: PoseNumbers) -> str:
    """Return how far a pose is from an earlier one; empty if it is the same up to the tolerance of a motion."""
    distance = math.dist(old[:3], new[:3])
    dot = abs(sum(one * other for one, other in zip(old[3:], new[3:], strict=True)))
    turned = 2 * math.acos(min(1.0, dot))
    if distance > POSITION_M:
        return f"starts {units.display(distance, 'm')} elsewhere"
    return f"starts turned by {units.display(turned, 'rad')}" if turned > ANGLE_RAD else ""
