"""Every rule of the audit: what breaks it, on which line, and that a good model breaks none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from sim_action.core.errors import RefusedModel
from sim_action.robot.audit.links import principal_moments
from sim_action.robot.documents.xml_document import read_document
from sim_action.robot.model.findings import ALLOWABLE, RULES, Finding
from sim_action.robot.reading.urdf import audit, read_urdf
from tests.mesh_files import CORNERS, HALF, moved, obj
from tests.robot.bad_models import BAD_MODELS, GOOD, BadModel
from tests.ros_workspace import written


def findings(folder: Path, text: str) -> list[Finding]:
    return audit(read_document(written(folder / "robot.urdf", text)))


def test_a_good_model_has_no_findings(tmp_path: Path) -> None:
    assert findings(tmp_path, GOOD) == []


VISUAL = (
    '<visual><geometry><box size="1 1 1"/></geometry><material{}><color rgba="1 0 0 1"/></material></visual></link>'
)


@pytest.mark.parametrize("bad", BAD_MODELS, ids=lambda bad: bad.name)
def test_a_bad_model_breaks_its_rule_on_its_line(bad: BadModel, tmp_path: Path) -> None:
    path = written(tmp_path / "robot.urdf", bad.text)
    if RULES[bad.rule].level == "warning":
        (found,) = read_urdf(path).findings
        assert (found.rule, found.location.line) == (bad.rule, bad.line)
        return
    with pytest.raises(RefusedModel) as refused:
        read_urdf(path)
    problem = refused.value.problems[0]
    assert problem.message.endswith(f"[{bad.rule}]")
    assert problem.location.line == bad.line
    assert problem.message.isprintable()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ('<cylinder radius="33" length="18"/>', "<cylinder> is 66 m large; models are in metres"),
        ('<sphere radius="25.5"/>', "<sphere> is 51 m large; models are in metres"),
        ('<cylinder radius="20" length="18"/>', "<cylinder> is 40 m large, but the other parts at most 0.2 m: is it"),
        ('<box size="21 1 1"/>', "<box> is 21 m large, but the other parts at most 0.2 m: is it"),
        ('<box size="19 1 1"/>', ""),
        ('<cylinder radius="4.9" length="9"/>', ""),
    ],
)
def test_a_part_in_millimetres_is_too_large(shape: str, message: str, tmp_path: Path) -> None:
    wheel = f'<link name="upper"><collision><geometry>{shape}</geometry></collision>'
    found = findings(tmp_path, GOOD.replace('radius="0.5"', 'radius="0.1"').replace('<link name="upper">', wheel))
    assert [each.message[: len(message)] for each in found if each.rule == "absurd-size"] == [message] * bool(message)


@pytest.mark.parametrize(("kind", "meant"), [("continous", "continuous"), ("Revolute", "revolute")])
def test_a_misspelled_joint_type_leads_to_the_nearest(kind: str, meant: str, tmp_path: Path) -> None:
    (found,) = findings(tmp_path, GOOD.replace('type="revolute"', f'type="{kind}"'))
    assert found.message.startswith(f"unknown joint type '{kind}'; did you mean '{meant}'? (allowed: revolute, ")


@pytest.mark.parametrize(
    ("leader", "follower", "mimic"),
    [
        ('lower="-1" upper="2"', 'lower="-1" upper="2"', ""),
        ('lower="-1" upper="2"', 'lower="-1.0005" upper="1.9995"', ""),
        ('lower="-1" upper="2"', 'lower="-4" upper="2"', 'multiplier="-2"'),
        ('lower="-1" upper="2"', 'lower="-1e16" upper="1e16"', 'multiplier="9"'),
        ('lower="-1e16" upper="1"', 'lower="-1" upper="1e16"', 'multiplier="-1"'),
        ('upper="1"', 'upper="1"', ""),
    ],
)
def test_a_follower_that_goes_as_far_as_its_leader_takes_it_is_left_alone(
    leader: str, follower: str, mimic: str, tmp_path: Path
) -> None:
    hinge = '<joint name="j" type="revolute"><parent link="base"/><child link="spare"/>'
    link = f'<link name="spare">{GOOD[GOOD.index("<inertial>") : GOOD.index("</inertial>")]}</inertial></link>'
    more = f'{hinge}<limit {follower}/><mimic joint="shoulder" {mimic}/></joint>{link}</robot>'
    assert findings(tmp_path, GOOD.replace('lower="-1" upper="2"', leader).replace("</robot>", more)) == []


def test_both_zeros_of_a_limit_are_told_at_once_and_not_of_a_joint_that_is_held(tmp_path: Path) -> None:
    text = GOOD.replace('effort="10" velocity="3"', 'effort="0" velocity="0"')
    (found,) = findings(tmp_path, text)
    assert "an effort of 0 and a velocity of 0" in found.message
    assert findings(tmp_path, text.replace("revolute", "fixed")) == []


def test_every_rule_has_a_model_that_breaks_it() -> None:
    # Rules of packages and xacro are in test_package_layouts.py, test_urdf.py and test_xacro_expansion.py.
    elsewhere = {"package-folder", "file-spelling", "several-packages", "xacro-warning"}
    elsewhere |= {"bad-xacro", "unknown-argument", "missing-include"}
    # Rules of SDF are in reading/sdf.
    elsewhere |= {"unknown-frame", "frame-loop", "include-loop", "unsupported-part", "unsupported-joint"}
    elsewhere |= {"default-inertia", "turned-base", "shared-friction"}
    # Rules of extensions and of MJCF are in tests/integration: test_model_extensions.py and test_native_masses.py.
    elsewhere |= {"start-position", "control-mimic", "lenient-xml", "moving-surface", "open-mesh"}
    # Parts are in test_part_table.py.
    elsewhere |= {"harmless-part"}
    # Rules of mesh files are in test_bad_meshes.py and test_mesh_references.py.
    elsewhere |= {"unknown-mesh-format", "broken-mesh", "empty-mesh", "mesh-index"}
    elsewhere |= {"too-large-mesh", "concave-mesh", "flat-mesh", "tiny-mesh"}
    assert {bad.rule for bad in BAD_MODELS} == set(RULES) - elsewhere


@pytest.mark.parametrize("rule", sorted({*ALLOWABLE} - {"unsupported-part", "unsupported-joint"}))
def test_an_error_can_be_let_go_and_is_told_all_the_same(rule: str, tmp_path: Path) -> None:
    bad = next(bad for bad in BAD_MODELS if bad.rule == rule)
    path = written(tmp_path / "robot.urdf", bad.text)
    others = {"zero-mass": "massless-model", "massless-model": "zero-mass"}
    model = read_urdf(path, allow=[rule, others.get(rule, rule)])
    assert rule in {finding.rule for finding in model.findings}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</link>", '<contact><restitution value="0"/></contact></link>'),
        ("</link>", '<contact><restitution value="0.0"/><lateral_friction value="0.8"/></contact></link>'),
        ("</robot>", "<gazebo reference='base'><restitution_coefficient>0</restitution_coefficient></gazebo></robot>"),
        ("</link>", VISUAL.format(' name=""')),  # the exporter of SolidWorks always writes an empty name
        ("</link>", VISUAL.format("")),
        ("</link>", '<visual><geometry><box size="1 1 1"/><box size=""/></geometry></visual></link>'),
        ('lower="-1" upper="2"', 'lower="-1e16" upper="1e16"'),
        ('lower="-1" upper="2"', 'lower="-12.566" upper="12.566"'),
        ('rpy="0 0 0"', 'rpy="0 -6.2832 6.2832"'),
    ],
)
def test_what_is_rare_but_right_is_not_told(old: str, new: str, tmp_path: Path) -> None:
    assert old in GOOD
    assert findings(tmp_path, GOOD.replace(old, new)) == []


@pytest.mark.parametrize(
    ("old", "new", "rule", "message"),
    [
        (
            "<dynamics",
            "<dynamic",
            "unknown-tag",
            "unknown element <dynamic> in <joint> is ignored; did you mean <dynamics>?",
        ),
        (
            'value="2"',
            f'value="{"9" * 10_000}"',
            "bad-number",
            f'<mass value="{"9" * 100}...">: expected a finite number of at most 1e+18',
        ),
        # The link below it is not reported as a loop.
        (
            '<parent link="base"/>',
            '<parent link="bas"/>',
            "unknown-link",
            "joint 'shoulder' names the unknown link 'bas'; did you mean 'base'? (allowed: base, upper)",
        ),
        *(
            ("1 2 3", text, "bad-number", f'<origin xyz="{text}">: expected {wanted}')
            for text, wanted in {
                "1 1 1 1": "3 finite numbers, found 4",
                "1, 2, 3": "3 finite numbers, separated by spaces, not commas",
                "1 2 1e999": "3 finite numbers of at most 1e+18",
                "1 2 -1E19": "3 finite numbers of at most 1e+18",
                "1 2 inf": "3 finite numbers",
                "1 2 x": "3 finite numbers",
            }.items()
        ),
    ],
)
def test_a_finding_says_what_is_wrong(old: str, new: str, rule: str, message: str, tmp_path: Path) -> None:
    (found,) = findings(tmp_path, GOOD.replace(old, new))
    assert (found.rule, found.message) == (rule, message)


def test_all_that_a_stage_finds_is_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace('mass value="2"', 'mass value="-2"').replace('radius="0.5"', 'radius="-1"')
    assert {finding.rule for finding in findings(tmp_path, text)} == {"negative-mass", "bad-shape"}


@pytest.mark.parametrize(("others", "rules"), [("200", []), ("2", ["odd-inertia"])])
def test_a_placeholder_is_told_where_it_counts(others: str, rules: list[str], tmp_path: Path) -> None:
    # An IMU of 1 g has had nobody's care, and beside 200 kg it needs none.
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    imu = f'<mass value="0.001"/>{inertia}</inertial><collision><geometry><box size="1e-2 1e-2 1e-2"/></geometry>'
    text = GOOD.replace(f'<mass value="1"/>{inertia}</inertial>', f"{imu}</collision>")
    assert text != GOOD
    path = written(tmp_path / "robot.urdf", text.replace('value="2"', f'value="{others}"'))
    assert [finding.rule for finding in read_urdf(path).findings] == rules


def test_the_reach_of_a_link_is_from_its_centre_of_mass_to_a_mesh_wherever_that_is_drawn(tmp_path: Path) -> None:
    # The box lies 10 m along x in its file, and the file lies 5 m along y in the link.
    (tmp_path / "far.obj").write_bytes(obj(moved(CORNERS, 10.0)))
    text = GOOD.replace('<sphere radius="0.5"/>', '<mesh filename="far.obj"/>').replace("1 2 3", "0 5 0")
    (tmp_path / "robot.urdf").write_text(re.sub('(i..)="1"', r'\1="1e9"', text).replace("0 0 0.1", "0 0 0"))
    found = read_urdf(tmp_path / "robot.urdf").findings
    reach = math.hypot(10.0, 5.0) + math.hypot(*HALF)
    assert any(f"extends only {reach:.2g} m" in finding.message for finding in found), found


@pytest.mark.parametrize(
    ("moments", "principal"),
    [
        ((1, 0, 0, 2, 0, 3), (1, 2, 3)),
        ((2, 0, 0, 2, 0, 2), (2, 2, 2)),
        ((2, 1, 0, 2, 0, 5), (1, 3, 5)),
        ((2, -1, 0, 2, 1, 2), (2 - 2**0.5, 2, 2 + 2**0.5)),
        ((0, 0, 0, 0, 0, 0), (0, 0, 0)),
    ],
)
def test_principal_moments_are_eigenvalues(
    moments: tuple[float, ...], principal: tuple[float, float, float], tmp_path: Path
) -> None:
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    element = next(read_document(written(tmp_path / "good.urdf", GOOD)).elements("link/inertial/inertia"))
    element.attrib.update({name: str(value) for name, value in zip(names, moments, strict=True)})
    assert principal_moments(element) == pytest.approx(principal, abs=1e-12)
