"""SDF joint axes against a table worked out from the specification, with rotation matrices that are computed here.

"Spec" is the description of an element at sdformat.org/spec. "Frame semantics" is SDFormat's proposal "Pose frame
semantics". "Converter" are the renamings that libsdformat makes before it reads an old file by the newest
specification.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.core.geometry import rotate
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from tests.robot.independent_readers import Matrix, turn_of_rpy
from tests.robot.reading.sdf.models import joint, link, load, rules, sdf
from tests.ros_workspace import written

Angles = tuple[float, float, float]
OLD: Final = ("1.3", "1.4")
FLAGGED: Final = ("1.5", "1.6")
NEW: Final = ("1.7", "1.9", "1.10", "1.11")
SINCE_15: Final = (*FLAGGED, *NEW)
ALL: Final = (*OLD, *SINCE_15)
AXIS: Final = (0.48, -0.6, 0.64)


# The angles of links, frames, joints and a nested model. A confusion of any two of them changes every axis.
ANGLES: Final[dict[str, Angles]] = {
    "a": (0.1, -0.4, 0.7),
    "b": (-0.9, 0.3, 0.2),
    "c": (0.6, 0.8, -0.3),
    "f": (1.1, -0.2, -0.5),
    "j": (0.25, 0.45, -1.3),
    "k": (-0.35, 1.2, 0.15),
    "n": (0.5, 0.05, 2.1),
}
# Spec, <pose>: roll about x, then pitch about y, then yaw about z, each about a fixed axis.
A, B, C, F, J, K, N = (turn_of_rpy(*angles) for angles in ANGLES.values())
MODEL: Final = np.eye(3)


def pose(name: str, attribute: str = "") -> str:
    return f"<pose {attribute}>0 0 0 {' '.join(map(repr, ANGLES[name]))}</pose>"


def axis(expressed_in: str | None = None, more: str = "") -> str:
    attribute = "" if expressed_in is None else f' expressed_in="{expressed_in}"'
    return f"<axis><xyz{attribute}>{' '.join(map(repr, AXIS))}</xyz>{more}</axis>"


def flag(value: str) -> str:
    return f"<use_parent_model_frame>{value}</use_parent_model_frame>"


def parts(axis_of_j: str, pose_of_j: str = pose("j"), pose_of_b: str = pose("b")) -> tuple[str, ...]:
    """The links a, b and c, the frame f, the joint k from a to c, and the joint j from a to b."""
    links = (link("a", pose("a")), link("b", pose_of_b), link("c", pose("c")))
    frame = f'<frame name="f">{pose("f")}</frame>'
    return *links, frame, joint("k", "a", "c", pose("k")), joint("j", "a", "b", pose_of_j + axis_of_j, "continuous")


@dataclass(frozen=True)
class Case:
    """A model; `expected`: the rotation from the frame of its axis to the model's frame; `child`: that of link b."""

    name: str
    versions: Sequence[str]
    parts: tuple[str, ...]
    expected: Matrix
    child: Matrix
    notes: tuple[str, ...] = ()


# Spec 1.3 and 1.4, <joint><axis>: "specified in the parent model frame".
# Spec 1.5 and 1.6, <xyz>: "expressed in the joint frame unless the use_parent_model_frame flag is set to true".
# Spec 1.7 and newer, <xyz expressed_in>: the frame that it names; if it is empty, the joint's frame.
# Spec, <joint><pose>: "By default, the pose of a joint is expressed in the child link frame".
CASES: Final = (
    Case("plain", OLD, parts(axis()), MODEL, B),
    Case("plain", SINCE_15, parts(axis()), B @ J, B),
    Case("empty expressed_in", SINCE_15, parts(axis("")), B @ J, B),
    Case("no joint pose", SINCE_15, parts(axis(), pose_of_j=""), B, B),
    # Spec 1.5, <use_parent_model_frame>. Converter: a version up to 1.4 gets the flag, unless it has one.
    Case("flag", FLAGGED, parts(axis(more=flag("true"))), MODEL, B),
    Case("flag as a number", FLAGGED, parts(axis(more=flag("1"))), MODEL, B),
    Case("flag false", FLAGGED, parts(axis(more=flag("false"))), B @ J, B),
    Case("flag false", OLD, parts(axis(more=flag("false"))), B @ J, B),
    # Converter: the flag of a file below 1.7 overwrites expressed_in.
    Case("flag and expressed_in", FLAGGED, parts(axis("a", flag("true"))), MODEL, B),
    Case("expressed_in", OLD, parts(axis("a")), MODEL, B),
    # Spec 1.7 and newer have no such flag.
    Case("flag", NEW, parts(axis(more=flag("true"))), B @ J, B, ("passed-over",)),
    # Frame semantics, 2.1: "__model__" is the frame of the model around the element.
    Case("expressed in the model", SINCE_15, parts(axis("__model__")), MODEL, B),
    # Frame semantics, 1.2: the name of a link, of a frame or of a joint. Converter: also below 1.7.
    Case("expressed in the parent", SINCE_15, parts(axis("a")), A, B),
    Case("expressed in the child", SINCE_15, parts(axis("b")), B, B),
    Case("expressed in another link", SINCE_15, parts(axis("c")), C, B),
    Case("expressed in a frame", SINCE_15, parts(axis("f")), F, B),
    Case("expressed in a joint", SINCE_15, parts(axis("k")), C @ K, B),
    Case("expressed in itself", SINCE_15, parts(axis("j")), B @ J, B),
    # Spec 1.7 and newer, <pose relative_to>. Converter: `frame` of 1.5 and 1.6 becomes relative_to.
    Case("joint relative to a link", SINCE_15, parts(axis(), pose("j", 'relative_to="a"')), A @ J, B),
    Case("joint relative to a frame", SINCE_15, parts(axis(), pose("j", 'relative_to="f"')), F @ J, B),
    Case("joint relative to the model", SINCE_15, parts(axis(), pose("j", 'relative_to="__model__"')), J, B),
    Case("joint in a frame", FLAGGED, parts(axis(), pose("j", 'frame="a"')), A @ J, B),
    Case("joint in a frame", NEW, parts(axis(), pose("j", 'frame="a"')), B @ J, B, ("passed-over",)),
    Case("child relative to a link", SINCE_15, parts(axis(), pose_of_b=pose("b", 'relative_to="a"')), A @ B @ J, A @ B),
    Case("child in a frame", FLAGGED, parts(axis("__model__"), pose_of_b=pose("b", 'frame="a"')), MODEL, A @ B),
)


def rows(cases: Sequence[Case], versions: Sequence[str] = ALL) -> list[object]:
    chosen = [(version, case) for case in cases for version in case.versions if version in versions]
    return [pytest.param(version, case, id=f"{case.name}-{version}") for version, case in chosen]


def assert_axis(model: RobotModel, case: Case, around: Matrix, prefix: str = "") -> None:
    """Check the axis of joint j in the frame of its child, and in the frame of the base link a.

    :param around: the rotation from the frame that `case` is in to the outermost model's frame.
    """
    made = next(joint for joint in model.joints if joint.name.rpartition("::")[2] == "j")
    assert made.type == "continuous"
    direction = around @ case.expected @ np.array(AXIS)
    assert made.axis_xyz == pytest.approx(tuple((around @ case.child).T @ direction), abs=1e-12)
    child = link_poses(model, {})[f"{prefix}b"].orientation_xyzw
    assert rotate(child, made.axis_xyz) == pytest.approx(tuple((around @ A).T @ direction), abs=1e-12)


@pytest.mark.parametrize(("version", "case"), rows(CASES))
def test_an_axis_is_in_the_frame_that_its_version_names(version: str, case: Case, tmp_path: Path) -> None:
    model = load(tmp_path, sdf(*case.parts, version=version))
    assert_axis(model, case, MODEL)
    # The base link is turned on purpose.
    assert tuple(rule for rule in rules(model) if rule != "turned-base") == case.notes


@pytest.mark.parametrize(("version", "case"), rows(CASES, ("1.4", "1.6", "1.7")))
def test_an_included_file_keeps_the_rules_of_its_own_version(version: str, case: Case, tmp_path: Path) -> None:
    """Converter: each file is converted by its own version. Spec, <include><pose>: it places the model."""
    written(tmp_path / "inner.sdf", sdf(*case.parts, version=version))
    include = f"<include><uri>inner.sdf</uri><name>n</name>{pose('n')}</include>"
    assert_axis(load(tmp_path, sdf(include)), case, N, "n::")


@pytest.mark.parametrize(("version", "case"), rows([case for case in CASES if case.name in {"plain", "flag false"}]))
def test_a_nested_model_has_a_frame_of_its_own(version: str, case: Case, tmp_path: Path) -> None:
    """Spec up to 1.4: "the parent model" of an axis is the innermost model around its joint."""
    model = load(tmp_path, sdf(f'<model name="n">{pose("n")}{"".join(case.parts)}</model>', version=version))
    assert_axis(model, case, N, "n::")


@pytest.mark.parametrize("name", ["expressed in the model", "expressed in the parent", "plain"])
def test_a_merged_model_keeps_its_frame(name: str, tmp_path: Path) -> None:
    """Proposal "merge-include": "__model__" in the included file is a frame of the included model's pose."""
    case = next(case for case in CASES if case.name == name and "1.9" in case.versions)
    written(tmp_path / "inner.sdf", sdf(*case.parts))
    include = f'<include merge="true"><uri>inner.sdf</uri>{pose("n")}</include>'
    assert_axis(load(tmp_path, sdf(include, version="1.10")), case, N)


@pytest.mark.parametrize(
    ("expressed_in", "expected"),
    # Proposal "Model composition", 1.4.1: "::" leads into a nested model; the name of a model is its frame.
    [(None, N @ B @ J), ("__model__", MODEL), ("n", N), ("n::__model__", N), ("n::a", N @ A), ("n::f", N @ F)],
)
@pytest.mark.parametrize("version", ["1.7", "1.8", "1.11"])
def test_a_joint_to_a_link_of_a_nested_model(
    version: str, expressed_in: str | None, expected: Matrix, tmp_path: Path
) -> None:
    inner = "".join((link("a", pose("a")), link("b", pose("b")), f'<frame name="f">{pose("f")}</frame>'))
    turning = joint("j", "root", "n::b", pose("j") + axis(expressed_in), "continuous")
    outer = (link("root"), joint("i", "root", "n::a"), turning)
    model = load(tmp_path, sdf(f'<model name="n">{pose("n")}{inner}</model>', *outer, version=version))
    made = model.joints_by_name["j"]
    assert made.axis_xyz == pytest.approx(tuple((N @ B).T @ expected @ np.array(AXIS)), abs=1e-12)
