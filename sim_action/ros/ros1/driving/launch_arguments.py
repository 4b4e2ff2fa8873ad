"""The arguments that a launch file takes, held against those that it is given (wiki.ros.org/roslaunch/XML/arg)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.files import read_at_most
from sim_action.core.messages import did_you_mean

_MOST_BYTES: Final = 4_000_000


def argument_problems(file: Path, given: Sequence[str]) -> Iterator[tuple[int | None, str]]:
    """What is wrong with each argument, by its place, or with the file; roslaunch itself passes over a misspelt one."""
    try:
        root = ET.fromstring(read_at_most(file, _MOST_BYTES) or b"")  # noqa: S314 - of the user's own package
    except (OSError, ET.ParseError) as error:
        yield None, f"'{file.name}' is no launch file: {error}"
        return
    own = dict(_own(root))
    for index, argument in enumerate(given):
        name, sign, _ = argument.partition(":=")
        if not (sign and name.isidentifier()):
            yield index, f"'{argument}' is no argument of a launch file; write NAME:=VALUE"
        elif name not in own:
            yield index, f"'{file.name}' has no argument '{name}'{did_you_mean(name, own)}"
        elif own[name].get("value") is not None:
            yield index, f"'{name}' has a fixed value in '{file.name}'; only what has a default can be given another"
    stated = {argument.partition(":=")[0] for argument in given}
    for name, tag in own.items():
        if name not in stated and set(tag.attrib) <= {"name", "doc"}:
            yield None, f"'{file.name}' needs the argument '{name}': give it as {name}:=VALUE"


def _own(root: ET.Element) -> Iterator[tuple[str, ET.Element]]:
    """Name and tag of each, but for those that it hands on to files that it includes."""
    handed_on = {tag for include in root.iter("include") for tag in include.iter("arg")}
    return ((name, tag) for tag in root.iter("arg") if tag not in handed_on and (name := tag.get("name")))
