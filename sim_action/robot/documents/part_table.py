"""The tables of every element and attribute of URDF, SDF, MJCF and SRDF: read, harmless, reported or refused.

A table is the file `parts_FORMAT.json` in this folder. It maps places to rows of effect, names and text:

- place: the tag of an element, or `parent/tag` where a tag has several meanings; `*`: every place.
- effect: "read"; "harmless": the motion is the same without it; "reported": a finding names it; "moving": one names it
  in a model that moves; "refused".
- names: child elements, and attributes as `@name`, separated by commas; `*`: all others. `name=1|true` lists the values
  with which a reported part has no effect, and `name=0~0.02` values nearer to 0 than 0.02.
- text: the function or class that reads the part; the reason why it is harmless or refused; the consequence.

The table "world" has the rows in which models of a world differ from a robot in SDF; "gazebo_ros" has rows of plugins
that ROS 1 replaces, of their sensors (`PLUGIN/sensor`), and of the <gazebo> of a URDF in a launch.
"""

from __future__ import annotations

import json
import math
from collections.abc import Container, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final, Literal, NamedTuple
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass, field

Effect = Literal["read", "harmless", "reported", "moving", "refused"]
Format = Literal["urdf", "sdf", "world", "gazebo_ros", "mjcf", "srdf"]
_MAX_SHOWN: Final = 60
ALL: Final = "*"  # As a place: every place. As a name: every name that the other rows of a place lack.


@dataclass(frozen=True, eq=False)
class PartRow:
    """The effect of the parts in one row; `neutral`: name -> the values with which it has none."""

    effect: Effect
    names: tuple[str, ...]
    text: str
    neutral: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def is_lost(self, name: str, value: str, *, moves: bool = True) -> bool:
        """Return True if a part with this value is reported, in a model that moves or does not."""
        lost = ("reported", "moving") if moves else ("reported",)
        return self.effect in lost and not any(_is_equal(value, usual) for usual in self.neutral.get(name, ()))


class Unread(NamedTuple):
    """A part that is not read: an element, or an attribute of it; `row`: None if the format has no such part."""

    element: Element
    place: str
    name: str
    row: PartRow | None

    @property
    def value(self) -> str:
        """The value of an attribute, or the text of an element or of its attribute `value`."""
        if self.name.startswith("@"):
            return self.element.attrib[self.name[1:]]
        return self.element.get("value", self.element.text or "").strip()

    @property
    def stated(self) -> str:
        """The part as messages show it."""
        value = self.value if len(self.value) <= _MAX_SHOWN else f"{self.value[:_MAX_SHOWN]}..."
        if self.name.startswith("@"):
            return f'<{self.element.tag} {self.name[1:]}="{value}">'
        return f"<{self.name}>{value}</{self.name}>" if value else f"<{self.name}>"


@dataclass(frozen=True, eq=False)
class PartTable:
    """The table of a format; `places`: place -> name -> its row."""

    places: Mapping[str, Mapping[str, PartRow]]
    _read: Mapping[str, frozenset[str]]

    def place(self, parent: str, tag: str) -> str:
        """Return the place of an element with this tag in an element of another place."""
        own = f"{parent.rpartition('/')[2]}/{tag}"
        return own if own in self.places else tag

    def row(self, place: str, name: str) -> PartRow | None:
        """Return the row of a child element or an @attribute at a place; None if the format has no such part."""
        rows = self.places.get(place, {})
        prefixed = f"{name.partition(':')[0]}:*" if ":" in name else name
        return rows.get(name) or rows.get(prefixed) or self.places.get(ALL, {}).get(name) or rows.get(ALL)

    def attributes(self, element: Element, place: str) -> Iterator[Unread]:
        """Yield the attributes of an element that are not read."""
        others = element.attrib.keys() - self._read.get(place, frozenset())
        # In the order of the file.
        for name in filter(others.__contains__, element.attrib) if others else ():
            row = self.row(place, f"@{name}")
            if (row is None or row.effect != "read") and not name.startswith("xmlns"):
                yield Unread(element, place, f"@{name}", row)

    def unread(self, element: Element, place: str, apart: Container[str] = ()) -> Iterator[Unread]:
        """Yield each part that is not read, and nothing below it; `apart`: tags that are not looked into."""
        yield from self.attributes(element, place)
        for child in element:
            row = self.row(place, child.tag)
            if row is None or row.effect != "read":
                yield Unread(child, place, child.tag, row)
            elif ALL not in row.names and child.tag not in apart:
                yield from self.unread(child, self.place(place, child.tag), apart)


@cache
def part_table(name: Format) -> PartTable:
    """Return the table of a format."""
    data = json.loads((Path(__file__).parent / f"parts_{name}.json").read_text(encoding="utf-8"))
    places: dict[str, Mapping[str, PartRow]] = {**part_table("sdf").places} if name == "world" else {}
    for names, rows in data.items():
        rows_by_part = {part: row for row in (_row(*row) for row in rows) for part in row.names}
        places |= {place: {**places.get(place, {}), **rows_by_part} for place in names.split(", ")}
    read = {
        place: frozenset(part[1:] for part, row in rows.items() if part[0] == "@" and row.effect == "read")
        for place, rows in places.items()
    }
    return PartTable(places, read)


def _row(effect: Effect, names: str, text: str) -> PartRow:
    stated = [name.partition("=") for name in names.split(", ")]
    neutral = {name: tuple(values.split("|")) for name, _, values in stated if values}
    return PartRow(effect, tuple(name for name, *_ in stated), text, neutral)


def _is_equal(value: str, usual: str) -> bool:
    """Return True if two values are the same text, flag or numbers; one number stands for any count of it."""
    usual, _, margin = usual.partition("~")
    stated, usual_numbers = _numbers(value), _numbers(usual)
    if stated is None or usual_numbers is None:
        return value.lower() == usual.lower()
    if margin:
        return all(abs(number - usual_numbers[0]) < float(margin) for number in stated)
    return stated == usual_numbers or (len(usual_numbers) == 1 and set(stated) == set(usual_numbers))


def _numbers(text: str) -> tuple[float, ...] | None:
    words = {"true": "1", "false": "0"}
    try:
        numbers = tuple(float(words.get(word.lower(), word)) for word in text.split())
    except ValueError:
        return None
    return numbers if numbers and all(map(math.isfinite, numbers)) else None
