"""What can be said against a model before an engine sees it: an explicit table of rules, in stages.

A stage may rely on what the ones before it have found to hold; all that one stage finds is told at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from sim_action.robot.audit import (
    attributes,
    engine_tables,
    gazebo,
    inertia,
    joints,
    shapes,
    spelling,
    structure,
    units,
)
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Finding

Check = Callable[[ModelDocument], Iterator[Finding]]

STAGES: Final[tuple[tuple[Check, ...], ...]] = (
    (attributes.robot, attributes.required, attributes.children),
    (attributes.numbers, gazebo.numbers),
    (structure.names, structure.joint_types, structure.tree, engine_tables.counts, shapes.kinds),
    (
        joints.axes,
        joints.limits,
        joints.motors,
        joints.kinds,
        joints.mimics,
        joints.reaches,
        shapes.sizes,
        shapes.extents,
        shapes.presence,
        inertia.masses,
        inertia.tensors,
        inertia.presence,
        gazebo.references,
        gazebo.directions,
        units.angles,
        units.limits,
        spelling.tags,
        spelling.repeated,
    ),
)


def audit(document: ModelDocument) -> list[Finding]:
    """Everything that the first stage with something fatal in it finds, and all that is found before it."""
    findings: list[Finding] = []
    for stage in STAGES:
        findings += [finding for check in stage for finding in check(document)]
        if any(finding.level == "fatal" for finding in findings):
            break
    return findings
