"""Losses: the parts of a world file that Gazebo simulates and sim-action does not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel

_STATED: Final = re.compile(r"<(\w+)>[^<]*</\1>")


class Loss(FrozenModel):
    """One part that is not simulated.

    Attributes:
        location: its place in a file of the user, if it is known.
        kind: the same for all losses of one kind; empty: the message.
        is_missing: True if a file that the world names cannot be used, so that an obstacle is missing.
        is_remark: True if it is only a remark: everything is simulated.
    """

    message: str
    location: Location | None = None
    kind: str = ""
    is_missing: bool = False
    is_remark: bool = False


class LossList:
    """The losses of one world file, in the order in which they were found.

    Attributes:
        places: the file and line of each element.
    """

    def __init__(self, places: Mapping[Element, Location]) -> None:
        self.places = places
        self.found: list[Loss] = []

    def add(self, element: Element, message: str, owner: str = "", *, kind: str = "", is_missing: bool = False) -> None:
        """Add a loss at an element; `owner`: name of its model, which the message names at its end."""
        kind = kind or _STATED.sub(r"<\1>", message)
        message = f"{message} ('{owner}')" if owner else message
        place = self.places.get(element)
        self.found.append(Loss(message=message, location=place, kind=kind, is_missing=is_missing))

    def remark(self, element: Element, message: str, kind: str) -> None:
        """Add a remark at an element."""
        place = self.places.get(element)
        self.found.append(Loss(message=message, location=place, kind=kind, is_remark=True))


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
