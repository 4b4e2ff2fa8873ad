"""Losses: the parts of a world file that Gazebo simulates and sim-action does not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel
from sim_action.robot.documents.part_table import part_table

_STATED: Final = re.compile(r"<(\w+)>[^<]*</\1>")


class Loss(FrozenModel):
    """One part that is not simulated."""

    message: str
    location: Location | None = None  # its place in a file of the user, if it is known
    kind: str = ""  # the same for all losses of one kind; empty: the message
    is_missing: bool = False  # True if a file that the world names cannot be used, so that an obstacle is missing
    is_remark: bool = False  # True if it is only a remark: everything is simulated


class LossList:
    """The losses of one world file in the order of the search; `places`: file and line of each element."""

    def __init__(self, places: Mapping[Element, Location]) -> None:
        self.places = places
        self.entries: list[Loss] = []

    def add(self, element: Element, message: str, owner: str = "", *, kind: str = "", is_missing: bool = False) -> None:
        """Add a loss at an element; `owner`: name of its model, which the message names at its end."""
        kind = kind or _STATED.sub(r"<\1>", message)
        message = f"{message} ('{owner}')" if owner else message
        place = self.places.get(element)
        self.entries.append(Loss(message=message, location=place, kind=kind, is_missing=is_missing))

    def remark(self, element: Element, message: str, kind: str) -> None:
        """Add a remark at an element."""
        place = self.places.get(element)
        self.entries.append(Loss(message=message, location=place, kind=kind, is_remark=True))


HARMLESS_WORLD_PLUGINS: Final[Mapping[str, str]] = {
    "gazebo_ros_api_plugin": "its services and topics are those of sim-action",
    "gazebo_ros_paths_plugin": "it sets search paths, which sim-action takes from packages",
    "gazebo_ros_init": "it starts ROS 2 in Gazebo",
    "gazebo_ros_factory": "it spawns models for nodes of ROS 2",
    **{
        f"{generation}-{system}-system": "it runs a part of Gazebo itself"
        for generation in ("gz-sim", "ignition-gazebo")
        for system in ("physics", "user-commands", "scene-broadcaster", "sensors", "imu", "contact", "log")
    },
}
"""Plugin of a world -> the reason why its absence is not a loss."""

_APART: Final = frozenset({"model", "include", "link"})  # elements whose parts are looked at with their own models


def lost_parts(holder: Element, place: str = "", *, moves: bool = False) -> Iterator[tuple[Element, str]]:
    """Yield each lost part of an element and of all below it, with its message; `moves`: its model moves."""
    table = part_table("world")
    for part in table.unread(holder, place or holder.tag, _APART):
        is_nothing = part.place == "state" and not (len(part.element) or part.value)
        is_fixed = part.name == "joint" and part.element.get("type") == "fixed" and holder.tag != "world"
        if part.row is None:
            name = part.stated if part.name.startswith("@") else f"<{part.name}>"
            yield part.element, f"{name} of <{part.place.rpartition('/')[2]}> is not supported and has no effect"
        elif part.row.is_lost(part.name, part.value, moves=moves) and not (is_fixed or is_nothing):
            yield part.element, f"{part.stated} is not simulated: {part.row.text}"


_MAX_KINDS: Final = 50


def by_kind(losses: Iterable[Loss]) -> Iterator[Loss]:
    """Yield one loss for each kind, at the first place, with the number of places."""
    kinds: dict[str, list[Loss]] = {}
    for loss in losses:
        kinds.setdefault(loss.kind, []).append(loss)
    for number, (kind, same) in enumerate(kinds.items()):
        if number == _MAX_KINDS:
            more = f"{len(kinds) - number} more kinds of parts are not simulated"
            yield Loss(message=more, location=same[0].location, kind=more)
            return
        first = same[0]
        message = first.message if len(same) == 1 else f"{kind} ({len(same)} times in the world; this is the first)"
        yield first.model_copy(update={"message": message})
