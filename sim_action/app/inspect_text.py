"""An inspection for people."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Final

from sim_action.app.inspect import Inspection, JointEntry
from sim_action.core import units
from sim_action.core.geometry import Vector3
from sim_action.core.messages import log_line
from sim_action.robot.robot_model import WORLD, Finding

_WIDTH: Final = 80
_LONGEST_NAME: Final = 60
_AXES: Final = {sign * place: f"{'-' * (sign < 0)}{name}" for place, name in enumerate("xyz", 1) for sign in (1, -1)}


def inspection_text(found: Inspection) -> str:
    """What it is, its joints as a tree, what the audit found, and a block to paste."""
    block = ["to paste into a scenario in this folder:", "", found.robot]
    parts = (_summary(found), _tree(found), _findings(found), block)
    return "\n\n".join("\n".join(map(log_line, "\n".join(part).split("\n"))) for part in parts)


def _summary(found: Inspection) -> Iterator[str]:
    moving = sum(joint.type != "fixed" for joint in found.joints)
    name = found.name if len(found.name) <= _LONGEST_NAME else f"{found.name[:_LONGEST_NAME]}..."
    yield f"{name}: {len(found.links)} links, {len(found.joints)} joints ({moving} move), {found.mass:.4g} kg"
    if found.lower_xyz and found.upper_xyz and found.height is not None:
        sizes = (_length(upper - lower) for lower, upper in zip(found.lower_xyz, found.upper_xyz, strict=True))
        yield f"its collision shapes fill {' x '.join(sizes)} m (x, y, z)"
        if found.root == WORLD:
            lowest = f"its lowest shape is {_above(found.lower_xyz[2])} the ground"
            yield from _wrapped(f"bolted to the world, its base link '{WORLD}' is at the origin; {lowest}")
        else:
            yield f"standing, its base link '{found.root}' is {_above(found.height)} the ground"
    for wheel in found.wheels:
        x, y, _ = map(_length, wheel.position_xyz)
        yield f"wheel: {wheel.joint}, radius {_length(wheel.radius)} m, at x = {x} m, y = {y} m"
    if found.drive:
        yield from _wrapped(f"recognised: {found.drive}")
    elif found.wheels:
        yield "how these drive is not plain: robot.drive has to say it"


def _above(height: float) -> str:
    return f"{_length(abs(height))} m {'below' if round(height, 4) < 0 else 'above'}"


def _length(metres: float) -> str:
    """To a tenth of a millimetre: a file's digits of pi leave less than that behind."""
    return f"{round(metres, 4) + 0.0:.4g}"


def _tree(found: Inspection) -> Iterator[str]:
    children: dict[str, list[JointEntry]] = {}
    for joint in found.joints:
        children.setdefault(joint.parent, []).append(joint)
    masses = {link.name: link.mass for link in found.links}
    yield _link(found.root, masses)
    yield from _below(found.root, children, masses, "")


def _below(
    link: str, children: dict[str, list[JointEntry]], masses: dict[str, float | None], stem: str
) -> Iterator[str]:
    joints = children.get(link, [])
    for joint in joints:
        last = joint is joints[-1]
        yield f"{stem}{'`-' if last else '|-'} {_joint(joint)} -> {_link(joint.child, masses)}"
        yield from _below(joint.child, children, masses, f"{stem}{'   ' if last else '|  '}")


def _link(name: str, masses: dict[str, float | None]) -> str:
    mass = masses[name]
    return name if mass is None else f"{name} ({units.display(mass, 'kg')})"


def _joint(joint: JointEntry) -> str:
    if joint.type == "fixed":
        return f"{joint.name} [fixed]"
    way = "along" if joint.type == "prismatic" else "about"
    return f"{joint.name} [{', '.join((f'{joint.type} {way} {_axis(joint.axis_xyz)}', *_details(joint)))}]"


def _axis(direction: Vector3) -> str:
    """Such as "-z", or all three parts of one that is askew."""
    along = [place * round(part) for place, part in enumerate(direction, 1) if abs(part) > 1 - 1e-6]
    return _AXES[along[0]] if along else " ".join(f"{part:.3g}" for part in direction)


def _details(joint: JointEntry) -> Iterator[str]:
    unit = "m" if joint.type == "prismatic" else "rad"
    if (joint.lower, joint.upper) != (None, None):
        lower, upper = (None if end is None else units.display(end, unit) for end in (joint.lower, joint.upper))
        yield f"{lower.split()[0]} to {upper}" if lower and upper else f"from {lower}" if lower else f"up to {upper}"
    if joint.mimics is not None:
        yield f"follows {joint.mimics}"
    elif joint.start:
        yield f"begins at {units.display(joint.start, unit)}"


def _findings(found: Inspection) -> Iterator[str]:
    if not found.findings:
        yield "the audit found nothing"
        return
    yield "the audit found:"
    for rule in dict.fromkeys(finding.rule for finding in found.findings):
        same = [finding for finding in found.findings if finding.rule == rule]
        yield f"{same[0].level} {rule}{', to be let go by robot.allow' if rule in found.needs else ''}"
        for message in dict.fromkeys(finding.message for finding in same):
            yield from _wrapped(_places([finding for finding in same if finding.message == message]), "  ")


def _places(findings: list[Finding]) -> str:
    """One finding, and where else the same was found."""
    first, *others = findings
    lines = ", ".join(str(finding.location.line) for finding in others)
    also = f" (also on line{'s' * (len(others) > 1)} {lines})" if others else ""
    return f"{first.location}: {first.message}{also}"


def _wrapped(text: str, indent: str = "") -> list[str]:
    # Paths stay whole, for those who click or copy them.
    below = f"{indent}  "
    return textwrap.wrap(
        text, _WIDTH, initial_indent=indent, subsequent_indent=below, break_long_words=False, break_on_hyphens=False
    )
