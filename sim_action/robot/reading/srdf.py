"""SRDF (wiki.ros.org/srdf, MoveIt): groups of joints, poses of groups, and pairs of links that never collide."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import ModelError, Problem, RefusedModel
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.robot_model import RobotModel, Srdf

_MAX_PROBLEMS: Final = 100


def read_srdf(path: Path, model: RobotModel) -> Srdf:
    """Read an SRDF and check it against its model. Raises ModelError, and RefusedModel with all problems."""
    reader = _Reader(read_srdf_text(path), model)
    found = reader.read()
    if reader.problems:
        raise RefusedModel(reader.problems[:_MAX_PROBLEMS])
    return found


def read_srdf_text(path: Path) -> ModelDocument:
    """Read an SRDF without its model. Raises ModelError."""
    document = read_document(path)
    if document.root.tag != "robot":
        place = document.places[document.root]
        raise ModelError(f"an SRDF begins with <robot name=...>, found <{document.root.tag}>", place)
    if any(True for _ in document.elements("link", "joint[@type]")):
        place = document.places[next(document.elements("link", "joint[@type]"))]
        raise ModelError("this is a URDF, which has links and joints; robot.srdf names the .srdf file beside it", place)
    return document


class _Reader:
    """Reads one document; `problems` grows meanwhile."""

    def __init__(self, document: ModelDocument, model: RobotModel) -> None:
        self._document, self._model = document, model
        self.problems: list[Problem] = []
        self._hinted = FirstFew()
        self._above = {joint.child: joint for joint in model.joints}
        self._groups = {element.get("name", ""): element for element in document.elements("group")}
        # MoveIt's <virtual_joint> joins the robot to the world.
        self._virtual = {element.get("name", "") for element in document.elements("virtual_joint")}
        self._parts: dict[str, set[str]] = {}
        for joint in model.joints:
            for whole in filter(None, (joint.ball, joint.series)):
                self._parts.setdefault(whole, set()).add(joint.name)

    def read(self) -> Srdf:
        self._check_name()
        order = {joint.name: place for place, joint in enumerate(self._model.joints)}
        groups = self._joints_of_groups()
        return Srdf(
            {name: tuple(sorted(joints, key=order.__getitem__)) for name, joints in groups.items()},
            dict(self._states(groups)),
            frozenset(self._pairs()),
            frozenset(self._passive()),
        )

    def _check_name(self) -> None:
        name, root = self._document.root.get("name"), self._document.root
        if name is not None and name != self._model.name:
            found = f"this SRDF is of robot '{name}', and the model is '{self._model.name}'"
            self._note(root, f"{found}; name the SRDF of the model, or correct <robot name=...>")

    def _joints_of_groups(self) -> dict[str, set[str]]:
        """Return the joints of each group: its own, those of its links and chains, and those of its groups."""
        inner = {name: dict.fromkeys(self._inner_groups(element)) for name, element in self._groups.items()}
        try:
            order = [*TopologicalSorter(inner).static_order()]
        except CycleError as error:
            # Each group of the cycle is followed by the group that contains it.
            inside, outside = error.args[1][:2]
            part = next(each for each in self._groups[outside].iterfind("group") if each.get("name", "") == inside)
            self._note(part, f"group '{inside}' contains itself; remove it from group '{outside}'")
            return {name: set() for name in self._groups}
        found: dict[str, set[str]] = {}
        # A group stands after all groups in it.
        for name in order:
            found[name] = self._own_joints(self._groups[name]).union(*(found[each] for each in inner[name]))
        return {name: found[name] for name in self._groups}

    def _inner_groups(self, group: Element) -> Iterator[str]:
        for part in group.iterfind("group"):
            name = part.get("name", "")
            if name in self._groups:
                yield name
            else:
                self._note(part, f"there is no group '{name}'{self._hint(name, self._groups)}")

    def _own_joints(self, group: Element) -> set[str]:
        found = set[str]()
        for part in group:
            if part.tag == "joint":
                found |= self._joint(part, "name")
            elif part.tag == "link":
                found |= self._joint_above(part)
            elif part.tag == "chain":
                found |= self._chain(part)
        return found

    def _joint(self, element: Element, attribute: str) -> set[str]:
        name = element.get(attribute, "")
        if name in self._model.joints_by_name:
            return {name}
        parts = self._parts.get(name, set())
        if not parts and name not in self._virtual:
            hint = self._hint(name, self._model.joints_by_name)
            self._note(element, f"the model has no joint '{name}'{hint}")
        return parts

    def _joint_above(self, element: Element) -> set[str]:
        link = self._link(element, "name")
        return {self._above[link].name} if link in self._above else set()

    def _link(self, element: Element, attribute: str) -> str:
        name = element.get(attribute, "")
        if name not in self._model.links_by_name:
            self._note(element, f"the model has no link '{name}'{self._hint(name, self._model.links_by_name)}")
        return name

    def _chain(self, element: Element) -> set[str]:
        base, tip = self._link(element, "base_link"), self._link(element, "tip_link")
        found, link = set[str](), tip
        while link != base and link in self._above:
            found.add(self._above[link].name)
            link = self._above[link].parent
        known = self._model.links_by_name
        if link != base and base in known and tip in known:
            found_none = f"no chain of joints leads from link '{base}' to link '{tip}'"
            self._note(element, f"{found_none}; swap them, or correct one")
            return set()
        return found

    def _states(self, groups: Mapping[str, set[str]]) -> Iterator[tuple[tuple[str, str], dict[str, float]]]:
        for element in self._document.elements("group_state"):
            group, positions = element.get("group", ""), dict[str, float]()
            if group not in groups:
                self._note(element, f"there is no group '{group}'{self._hint(group, groups)}")
            for part in element.iterfind("joint"):
                written = part.get("value", "")
                for name in self._joint(part, "name"):
                    position = _number(written)
                    if position is None:
                        self._note(part, f"value=\"{written}\" of joint '{name}': expected a finite number in rad or m")
                    else:
                        positions[name] = position
            yield (group, element.get("name", "")), positions

    def _pairs(self) -> Iterator[frozenset[str]]:
        enabled = {self._pair(element) for element in self._document.elements("enable_collisions")}
        for element in self._document.elements("disable_collisions"):
            yield self._pair(element)
        for element in self._document.elements("disable_default_collisions"):
            link = self._link(element, "link")
            yield from {frozenset((link, other)) for other in self._model.links_by_name if other != link} - enabled

    def _pair(self, element: Element) -> frozenset[str]:
        return frozenset((self._link(element, "link1"), self._link(element, "link2")))

    def _passive(self) -> Iterator[str]:
        for element in self._document.elements("passive_joint"):
            yield from self._joint(element, "name")

    def _hint(self, name: str, allowed: Mapping[str, object]) -> str:
        return did_you_mean(name, allowed) if self._hinted.one_more() else ""

    def _note(self, element: Element, message: str) -> None:
        if len(self.problems) <= _MAX_PROBLEMS:
            problem = Problem(self._document.places[element], message)
            if problem not in self.problems:
                self.problems.append(problem)


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
