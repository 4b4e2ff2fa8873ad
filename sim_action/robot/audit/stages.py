"""Run the checks of the audit, in stages.

A stage relies on the facts that the stages before it have established. All findings of one stage are reported together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from sim_action.robot.audit import elements, gazebo_tags, inertia, joints, kinematic_tree, shapes
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.robot_model import Finding

Check = Callable[[ModelDocument], Iterator[Finding]]

STAGES: Final[tuple[tuple[Check, ...], ...]] = (
    (elements.root, elements.required_attributes, elements.required_children),
    (elements.default_expressions, elements.numbers, gazebo_tags.coefficients),
    (
        kinematic_tree.names,
        kinematic_tree.joint_types,
        kinematic_tree.tree,
        kinematic_tree.joint_counts,
        shapes.kinds,
    ),
    (
        joints.axes,
        joints.limits,
        joints.motors,
        joints.passive,
        joints.mimics,
        joints.mimic_limits,
        shapes.sizes,
        shapes.extents,
        shapes.presence,
        inertia.masses,
        inertia.tensors,
        inertia.presence,
        gazebo_tags.references,
        gazebo_tags.frictions,
        gazebo_tags.unsupported_parts,
        elements.restitutions,
        shapes.angles,
        joints.limit_units,
        elements.misspelled_tags,
        gazebo_tags.misspelled_parts,
        elements.repeated_inertials,
    ),
)


def audit(document: ModelDocument) -> list[Finding]:
    """Return the findings of all stages, up to and including the first stage with a fatal finding."""
    findings = list(document.findings)
    for stage in STAGES:
        findings += [finding for check in stage for finding in check(document)]
        if any(finding.level == "fatal" for finding in findings):
            break
    return findings
