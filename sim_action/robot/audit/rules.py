"""What is wrong or odd about a model. Each finding has the name of its rule, by which `robot.allow` lets it go."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from sim_action.core.errors import Location, Problem, RefusedModel
from sim_action.core.messages import escaped_line
from sim_action.robot.robot_model import Finding, Level


@dataclass(frozen=True, slots=True)
class Rule:
    """What is looked for."""

    level: Level
    summary: str


RULES: Final[Mapping[str, Rule]] = MappingProxyType(
    {
        "bad-xml": Rule("fatal", "XML that is not well-formed, too deep, too much, or has a DOCTYPE"),
        "bad-xacro": Rule("fatal", "xacro that cannot be evaluated"),
        "unknown-argument": Rule("fatal", "an argument in `robot.args` that the xacro file does not have"),
        "missing-include": Rule("fatal", "a file that is to be included and is not there"),
        "missing-package": Rule("fatal", "a package that is not there"),
        "outside-workspace": Rule("fatal", "a mesh, or a file to include, from outside the workspace"),
        "bad-reference": Rule("fatal", "an address that names no file"),
        "not-a-robot": Rule("fatal", "a file that is no robot model, or not one alone"),
        "missing-part": Rule("fatal", "an element without a part or an attribute that it must have"),
        "bad-number": Rule("fatal", "text where finite numbers are due"),
        "bad-name": Rule("fatal", "a name of a link or a joint that is longer than an engine takes"),
        "duplicate-name": Rule("fatal", "two links, or two joints, of one name"),
        "unknown-frame": Rule("fatal", "a name in SDF that leads to no link, joint, frame or model"),
        "frame-loop": Rule("fatal", "frames of SDF that are given relative to each other, or attached, in a circle"),
        "include-loop": Rule("fatal", "an SDF model that includes itself, or others without end"),
        "unknown-link": Rule("fatal", "a joint that names a link that is not there"),
        "two-parents": Rule("fatal", "a link that is the child of two joints"),
        "one-root": Rule("fatal", "no root link, or several"),
        "loop": Rule("fatal", "joints that lead back to where they began"),
        "joint-type": Rule("fatal", "a type of joint that is not known"),
        "too-many-joints": Rule("fatal", "more joints than the engine takes: 127, of which 121 move"),
        "unknown-shape": Rule("fatal", "a shape that cannot be part of a robot"),
        "bad-shape": Rule("fatal", "a size that is not greater than zero"),
        "zero-axis": Rule("fatal", "a moving joint about an axis of length 0"),
        "negative-mass": Rule("fatal", "a mass below zero"),
        "missing-mesh": Rule("fatal", "a collision mesh that is not there"),
        "unknown-mesh-format": Rule("fatal", "a collision mesh that is no STL, OBJ or DAE"),
        "broken-mesh": Rule("fatal", "a collision mesh that cannot be read"),
        "empty-mesh": Rule("fatal", "a collision mesh without a triangle that has an area"),
        "mesh-index": Rule("fatal", "a face of a collision mesh that names a point that is not there"),
        "too-large-mesh": Rule("fatal", "a collision mesh of more triangles or bytes than are read"),
        "unsupported-joint": Rule(
            "error", "a joint with more than one motion, floating or planar or a ball; let go, it is held still"
        ),
        "bad-mimic": Rule("error", "a joint that mimics none that moves by itself; let go, it moves by itself"),
        "unexpanded-expression": Rule("error", "a ${...} or $(...) of xacro; let go, it counts as left out"),
        "missing-visual": Rule("error", "a mesh to look at that is not there"),
        "missing-limits": Rule("error", "a revolute or prismatic joint without limits; let go, it moves without"),
        "reversed-limits": Rule("error", "a lower limit above the upper one; let go, it moves without"),
        "zero-mass": Rule("error", "a mass of 0; let go, a base is held still, any other link weighs next to nothing"),
        "impossible-inertia": Rule(
            "error",
            "an inertia that no body can have; let go, it is made one, by more about every axis; of 0: a small ball's",
        ),
        "massless-model": Rule("error", "a model in which no link has a mass"),
        "absurd-size": Rule("error", "a part larger than any robot: millimetres taken for metres"),
        "unsupported-part": Rule("error", "a part of SDF that is not simulated; let go, it is passed over"),
        "xacro-warning": Rule("warning", "what xacro itself warned of"),
        "locked-joint": Rule("warning", "a joint that cannot move: its limits are one number, often 0 for a wheel"),
        "concave-mesh": Rule("warning", "a collision mesh that is not convex: its hull is what collides"),
        "tiny-mesh": Rule("warning", "a collision mesh smaller than 1 mm: metres taken for millimetres"),
        "flat-mesh": Rule("warning", "a collision mesh without a volume"),
        "several-packages": Rule("warning", "a package that is there twice: the nearer one is taken"),
        "missing-inertia": Rule("warning", "a link without <inertial>: it gets a negligible mass"),
        "unknown-reference": Rule("warning", "a <gazebo> tag for a link or joint that is not there"),
        "two-frictions": Rule("warning", "a friction that depends on the direction: one coefficient counts"),
        "zero-limit": Rule("warning", "an effort or a velocity of 0 in a <limit>: it counts as none"),
        "follower-limits": Rule("warning", "a joint that mimics one that goes further than its own limits let it"),
        "odd-angle": Rule("warning", "a part turned by more than a whole turn: degrees taken for radians"),
        "odd-limits": Rule("warning", "a joint that goes further than any: degrees or millimetres"),
        "unknown-tag": Rule("warning", "an element that is read by nobody, of a name that is nearly one of URDF's"),
        "second-inertial": Rule("warning", "a link with more than one <inertial>: the first counts"),
        "odd-inertia": Rule("warning", "an inertia that no link of its mass and size has: in another unit"),
        "odd-mass": Rule("warning", "a model denser than any metal: its masses are in another unit"),
        "default-inertia": Rule("warning", "an <inertial> of SDF without a mass or moment: it is 1, as SDF has it"),
        "turned-base": Rule("warning", "a root link that SDF turns: robot.pose has to say so"),
        "passed-over": Rule("warning", "a property of an SDF model that is not simulated"),
        "no-collision-shape": Rule("warning", "a model without any collision shape: nothing can touch it"),
    }
)


# Each is a line in every report.
_MOST_TOLD: Final = 100

ALLOWABLE: Final = tuple(name for name, rule in RULES.items() if rule.level == "error")
"""What `robot.allow` may name."""


def finding(rule: str, message: str, location: Location) -> Finding:
    """A finding of a rule."""
    return Finding(rule, RULES[rule].level, escaped_line(message), location)


def refuse_errors(findings: Iterable[Finding], allowed: Iterable[str] = ()) -> None:
    """Raises RefusedModel if there is an error among them that nobody allowed."""
    lenient = set(allowed)
    refused = (
        Problem(finding.location, f"{finding.message} [{finding.rule}]")
        for finding in findings
        if finding.level == "fatal" or (finding.level == "error" and finding.rule not in lenient)
    )
    # A file that is included many times has the same to mend each time.
    problems = list(dict.fromkeys(refused))
    if len(problems) > _MOST_TOLD:
        more = _more(len(problems) - _MOST_TOLD)
        problems[_MOST_TOLD:] = [Problem(problems[_MOST_TOLD].location, more)]
    if problems:
        raise RefusedModel(problems)


def limited_notes(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """What is told of a model that was taken: the first findings of each rule, and how many more there are."""
    told, seen = list[Finding](), Counter[str]()
    left_out: dict[str, Finding] = {}
    for found in findings:
        seen[found.rule] += 1
        if seen[found.rule] <= _MOST_TOLD:
            told.append(found)
        else:
            left_out.setdefault(found.rule, found)
    rest = (replace(found, message=_more(seen[rule] - _MOST_TOLD)) for rule, found in left_out.items())
    return (*told, *rest)


def _more(count: int) -> str:
    return f"{count:,} more problems like these: what made this file may be at fault"
