"""An inspection for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from sim_action import units
from sim_action.geometry import Vector3
from sim_action.inspection import Inspection, JointEntry
from sim_action.messages import log_line


def inspection_text(found: Inspection) -> str:
    """What it is, its joints as a tree, what the audit found, and a block to paste."""
    parts = (_summary(found), _tree(found), _findings(found), f"to paste into a scenario:\n\n{found.robot}")
    return "\n\n".join("\n".join(map(log_line, part.split("\n"))) for part in parts if part)


def _summary(found: Inspection) -> str:
    moving = sum(joint.type != "fixed" for joint in found.joints)
    lines = [
        f"{found.name}: {len(found.links)} links, {len(found.joints)} joints ({moving} move), {found.mass:.4g} kg",
    ]
    if found.lower_xyz and found.upper_xyz and found.height is not None:
        lower, upper = found.lower_xyz, found.upper_xyz
        size: Vector3 = (upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2])
        lines.append(f"collision shapes fill {' x '.join(f'{length:.4g}' for length in size)} m")
        lines.append(f"standing, its base link '{found.root}' is {units.display(found.height, 'm')} above the ground")
    if found.drive:
        lines.append(f"recognised: {found.drive}")
    return "\n".join(lines)


def _tree(found: Inspection) -> str:
    children: dict[str, list[JointEntry]] = {}
    for joint in found.joints:
        children.setdefault(joint.parent, []).append(joint)
    masses = {link.name: link.mass for link in found.links}
    return "\n".join([_link(found.root, masses), *_below(found.root, children, masses, "")])


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
        return f"{joint.name} [{joint.type}]"
    axis = " ".join(f"{part:.3g}" for part in joint.axis_xyz)
    limits = _limits(joint)
    follows = f", follows {joint.mimics}" if joint.mimics else ""
    return f"{joint.name} [{joint.type} about {axis}{limits}{follows}]".replace("prismatic about", "prismatic along")


def _limits(joint: JointEntry) -> str:
    if joint.lower is None or joint.upper is None:
        return ""
    unit = "m" if joint.type == "prismatic" else "rad"
    return f", {units.display(joint.lower, unit)} to {units.display(joint.upper, unit)}"


def _findings(found: Inspection) -> str:
    lines: Iterable[str] = (f"{finding.level}: {finding}" for finding in found.findings)
    return "\n".join(("the audit found:", *lines)) if found.findings else "the audit found nothing"
