"""What a whole scenario must satisfy: here what its robot must; test_loading.py has times, rates and names."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.scenario.loading import build_scene
from tests.scenarios import load, told

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
INERTIAL = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
ARM = """\
<robot name="arm">
  <link name="base">{inertial}</link>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="hand"/><limit {limits}/></joint>
  <link name="hand"/>
</robot>
"""


def arm(folder: Path, robot: str = "", inertial: str = INERTIAL, limits: str = 'lower="-1" upper="1.5707963"') -> str:
    """A scenario with an arm in it, and with keys of `robot`."""
    (folder / "arm.urdf").write_text(ARM.format(inertial=inertial, limits=limits))
    return f"name: arm\nrobot: {{model: arm.urdf{robot}}}\nexpect: [upright]\ntime_limit: 1 s\nallow: [fixed-base]\n"


def test_a_free_base_without_mass_would_stand_still(tmp_path: Path) -> None:
    massless = f'<inertial><mass value="0"/>{INERTIA}</inertial>'
    allowed = ", allow: [zero-mass, massless-model]"
    (found,) = told(tmp_path, arm(tmp_path, allowed, massless))
    assert found == (
        "2:9: robot.model: the base link 'base' has no mass, so the engine would hold it still; "
        "say base: fixed, or give it a mass"
    )
    assert load(tmp_path, arm(tmp_path, f"{allowed}, base: fixed", massless))
    assert load(tmp_path, arm(tmp_path))


def test_a_free_robot_has_a_mass(tmp_path: Path) -> None:
    (found,) = told(tmp_path, arm(tmp_path, inertial=""))
    assert "no link of the model has a mass, so it cannot move freely; say base: fixed" in found
    assert load(tmp_path, arm(tmp_path, ", base: fixed", inertial=""))
    assert load(tmp_path, arm(tmp_path, ", allow: [massless-model]", inertial=""))


def test_a_rule_whose_findings_are_notes_may_be_allowed(tmp_path: Path) -> None:
    assert load(tmp_path, arm(tmp_path, ", allow: [missing-visual, zero-inertia]"))


@pytest.mark.parametrize(
    ("position", "problem"),
    [
        ("2", "114.6 deg is outside the limits of the joint, -57.3 deg to 90 deg"),
        ("-58 deg", "-58 deg is outside the limits of the joint, -57.3 deg to 90 deg"),
        ("90.001 deg", "90.001 deg is outside the limits of the joint, -57.3 deg to 90 deg"),
    ],
)
def test_a_joint_begins_within_its_limits(position: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, arm(tmp_path, f", joints: {{elbow: {position}}}"))
    assert found == f"2:35: robot.joints.elbow: {problem}"


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ('lower="0.5" upper="1e16"', "11.46 deg is outside the limits of the joint, 28.65 deg or more"),
        ('lower="-1e16" upper="-0.5"', "11.46 deg is outside the limits of the joint, -28.65 deg or less"),
    ],
)
def test_one_limit_is_told_as_one(limits: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, arm(tmp_path, ", joints: {elbow: 0.2}", limits=limits))
    assert found.endswith(problem)


@pytest.mark.parametrize(
    ("position", "limits"),
    [("90 deg", 'lower="-1" upper="1.5707963"'), ("9", 'effort="1"'), ("9", 'lower="0" upper="-1"')],
)
def test_a_joint_may_begin_at_its_limit_and_anywhere_without_one(position: str, limits: str, tmp_path: Path) -> None:
    allowed = "allow: [missing-limits, reversed-limits]"
    assert load(tmp_path, arm(tmp_path, f", {allowed}, joints: {{elbow: {position}}}", limits=limits))


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("missing-limit", "'missing-limit' is not a rule that can be allowed; did you mean 'missing-limits'?"),
        ("two-parents", "'two-parents' is not a rule that can be allowed; no engine accepts such a model"),
    ],
)
def test_only_rules_that_can_be_let_go_are_allowed(name: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, arm(tmp_path, f", allow: [{name}]"))
    assert problem in found


def test_a_typo_in_a_drive_is_one_problem_whatever_the_model(tmp_path: Path) -> None:
    text = arm(tmp_path, ", drive: {diff: {left: [elbow], right: [elbow], radios: 1}}")
    commands = "commands: {twist: [{linear: 1.0}], rate: 10 Hz}\n"
    (found,) = told(tmp_path, text + commands)
    assert "robot.drive.diff.radios: unknown key" in found


FOLLOWER = """\
  <joint name="tip" type="revolute"><parent link="hand"/><child link="finger"/>
    <limit lower="-0.2" upper="0.2"/><mimic joint="elbow" offset="{offset}"/></joint>
  <link name="finger"/>
</robot>
"""
BEYOND = "joint 'tip', which follows 'elbow', would begin beyond its own limits: "


@pytest.mark.parametrize(
    ("offset", "joints", "problem"),
    [
        (0, ", joints: {elbow: 0.8}", f"2:35: robot.joints.elbow: {BEYOND}45.84 deg is outside"),
        (0, ", joints: {elbow: -0.2001}", f"2:35: robot.joints.elbow: {BEYOND}-11.465 deg is outside"),
        (0.5, "", f"2:1: robot: {BEYOND}28.65 deg is outside"),
        (0, ", joints: {elbow: 0.2}", ""),
        (0.5, ", joints: {elbow: -0.4}", ""),
        (0, ", joints: {elbow: 1 m}", "2:35: robot.joints.elbow: "),
    ],
)
def test_a_follower_begins_within_its_own_limits(offset: float, joints: str, problem: str, tmp_path: Path) -> None:
    text = arm(tmp_path, joints)
    model = tmp_path / "arm.urdf"
    model.write_text(model.read_text().replace("</robot>\n", FOLLOWER.format(offset=offset)))
    if not problem:
        assert load(tmp_path, text)
        return
    (found,) = told(tmp_path, text)
    assert found.startswith(problem)


@pytest.mark.parametrize(
    ("joints", "positions"),
    [("{'*': 0.1}", {"elbow": 0.1, "tip": 0.1}), ("{'e*': 6 deg, elbow: 0.2}", {"elbow": 0.2, "tip": 0.2})],
)
def test_a_pattern_sets_joints_with_motors_and_a_name_wins(
    joints: str, positions: dict[str, float], tmp_path: Path
) -> None:
    text = arm(tmp_path, f", joints: {joints}")
    model = tmp_path / "arm.urdf"
    model.write_text(model.read_text().replace("</robot>\n", FOLLOWER.format(offset=0)))
    assert build_scene(load(tmp_path, text)).joint_positions == positions


@pytest.mark.parametrize(
    ("joints", "problems"),
    [
        ("{'*_hip': 1}", ["2:35: robot.joints.*_hip: no moving joint matches '*_hip' (allowed: elbow)"]),
        ("{'elb*': 2}", ["2:35: robot.joints.elb*: joint 'elbow': 114.6 deg is outside"]),
        (
            "{'e*': 0,\n '*w': 1}",
            ["2:35: robot.joints.e*: 'e*' sets joint 'elbow' to 0, '*w' to 1", "3:2: robot.joints.*w: 'e*' sets"],
        ),
    ],
)
def test_a_pattern_that_cannot_be_is_told_where_it_stands(joints: str, problems: list[str], tmp_path: Path) -> None:
    found = told(tmp_path, arm(tmp_path, f", joints: {joints}"))
    assert len(found) == len(problems)
    assert all(line.startswith(problem) for line, problem in zip(found, problems, strict=True))


def test_variables_are_for_code_only(tmp_path: Path) -> None:
    variables = "environment: {OPENSSL_CONF: ./ssl.cnf}\n"
    (found,) = told(tmp_path, arm(tmp_path) + variables)
    assert found == (
        "6:1: environment: nothing in this scenario runs code that could read variables (script, process, assertion, "
        "xacro or ROS nodes); remove it"
    )
    (tmp_path / "hold.py").write_text("def control(observation): ...\n")
    assert load(tmp_path, arm(tmp_path) + variables + "commands: {rate: 10 Hz, script: hold.py}\n")
    (found,) = told(tmp_path, arm(tmp_path) + variables + "commands: {rate: 10 Hz, script: missing.py}\n")
    assert "environment" not in found


def test_recorded_links_are_those_of_the_robot(tmp_path: Path) -> None:
    text = arm(tmp_path, ", base: fixed")
    assert load(tmp_path, f"{text}trace: {{links: [hand]}}\n").scenario.trace.links == ("hand",)
    (found,) = told(tmp_path, f"{text}trace: {{links: [hand, hnd]}}\n")
    assert found.startswith("6:23: trace.links.1: the robot has no link 'hnd'; did you mean 'hand'?")
