"""The check of xacro files as text, which runs nothing."""

from __future__ import annotations

import sys

import pytest

from sim_action.robot.reading.xacro_documents import XacroCheck
from tests.robot.xacro_models import URDF, told
from tests.ros_workspace import NAMESPACE, RosWorkspace, ros_package, written


def test_a_sound_robot_has_no_problems_and_says_that_it_was_not_run(ros: RosWorkspace) -> None:
    check = XacroCheck(ros.rover, ["mass"], ros.packages())
    assert check.problems == []
    when = f"xacro evaluates {ros.rover} when the scenario runs"
    assert check.notes == [f"links and joints: {when} (4 files checked as text)"]


def checked(ros: RosWorkspace, body: str, *arguments: str) -> tuple[list[str], list[str]]:
    """The problems, and the notes but for the one that always is."""
    check = XacroCheck(ros.robot(body), arguments, ros.packages())
    assert "when the scenario runs (" in check.notes[-1]
    notes = [note.replace(f"{ros.root}/{URDF}/", "") for note in check.notes[:-1]]
    return [f"{told(ros, problem)} [{problem.rule}]" for problem in check.problems], notes


def test_nothing_is_run_and_a_circle_is_walked_once(ros: RosWorkspace) -> None:
    assert checked(ros, '<xacro:include filename="test.urdf.xacro"/>') == ([], [])
    assert checked(ros, '<a x="${1 / 0}"/><xacro:nothing/><xacro:property name="p" value="exit(3)"/>') == ([], [])


def test_all_missing_includes_are_told(ros: RosWorkspace) -> None:
    inner = f'<robot {NAMESPACE}>\n<xacro:include filename="absent.xacro"/></robot>'
    ros.write(f"{URDF}/inner.xacro", inner)
    body = (
        '<xacro:include filename="inner.xacro"/>\n<xacro:include filename="whel.xacro"/>\n'
        '<xacro:include filename="$(find arm)/arm.xacro"/>\n<xacro:include filename="/etc/passwd"/>'
    )
    problems, notes = checked(ros, body)
    assert notes == []
    whel, arm, passwd, absent = problems
    assert whel.startswith("test.urdf.xacro:3: 'whel.xacro' does not exist (looked for ")
    assert "[missing-include]" in whel
    assert arm.startswith("test.urdf.xacro:4: ")
    assert "refers to the package 'arm', which was not found" in arm
    assert "[missing-package]" in arm
    assert "[outside-workspace]" in passwd
    assert absent.startswith("inner.xacro:2: 'absent.xacro' does not exist")


def test_bad_xml_is_told(ros: RosWorkspace) -> None:
    ros.write(f"{URDF}/inner.xacro", "<robot>\n<a></robot>")
    problems, _ = checked(ros, '<xacro:include filename="inner.xacro"/>')
    mismatched = "mismatched tag: found </robot>, expected the end of <a> from line 2"
    assert problems == [f"inner.xacro:2: not well-formed XML: {mismatched} [bad-xml]"]


@pytest.mark.parametrize(
    "name", ["${name}.xacro", "$(arg name).xacro", "parts/*.xacro", "$$(find arm)/a.xacro", "$(env HOME)/a.xacro"]
)
def test_what_depends_on_an_evaluation_is_noted(name: str, ros: RosWorkspace) -> None:
    problems, notes = checked(ros, f'\n<xacro:include filename="{name}"/>', "unknown")
    assert problems == []
    assert notes == [f"test.urdf.xacro:3: include '{name}': its name is not known before the run"]


@pytest.mark.parametrize(
    "body",
    [
        '<xacro:if value="$(arg a)"><xacro:include filename="absent.xacro"/></xacro:if>',
        '<xacro:unless value="1"><b><xacro:include filename="absent.xacro"/></b></xacro:unless>',
        '<xacro:macro name="m"><xacro:include filename="absent.xacro"/></xacro:macro>',
        '<xacro:include filename="absent.xacro" optional="true"/>',
    ],
)
def test_an_include_that_may_never_be_made_is_no_problem(body: str, ros: RosWorkspace) -> None:
    problems, (note,) = checked(ros, body)
    assert problems == []
    assert "'absent.xacro' does not exist" in note
    assert note.endswith("this matters only if the file is included")


def test_unknown_arguments_are_told_when_all_files_were_read(ros: RosWorkspace) -> None:
    problems, _ = checked(ros, '<xacro:arg name="mass" default="1"/>', "mas")
    unknown = "no <xacro:arg> has the name 'mas'; did you mean 'mass'? (allowed: mass)"
    assert problems == [f"test.urdf.xacro: robot.args: {unknown} [unknown-argument]"]
    assert checked(ros, '<xacro:include filename="${x}"/>', "mas")[0] == []
    # xacro takes an argument that is used without a declaration.
    for name, use in (("mas", "$(arg mas)"), ("arm-mass", "$(arg arm-mass )"), ("mas", "${xacro.arg('mas')}")):
        assert checked(ros, f'<xacro:if value="false"><a b="{use}"/></xacro:if>', name)[0] == []


def test_a_package_that_is_there_twice_is_noted(ros: RosWorkspace) -> None:
    for place in ("vendor", "src"):
        written(ros_package(ros.root / place / "arm") / "arm.xacro", "<robot/>")
    problems, (note,) = checked(ros, '<xacro:include filename="$(find arm)/arm.xacro"/>', "mas")
    assert note.startswith("test.urdf.xacro:2: 2 packages have the same name: ")
    assert problems == [
        "test.urdf.xacro: robot.args: no <xacro:arg> has the name 'mas' (allowed: none) [unknown-argument]"
    ]


def test_a_file_that_cannot_be_read_is_a_problem(ros: RosWorkspace) -> None:
    check = XacroCheck(ros.root / "absent.xacro", [], ros.packages())
    assert [problem.rule for problem in check.problems] == ["missing-include"]


@pytest.mark.process
def test_no_xacro_is_imported_to_look_at_a_file(ros: RosWorkspace) -> None:
    import subprocess

    code = (
        "import sys; from pathlib import Path; from sim_action.robot.reading.xacro_documents import XacroCheck;"
        "from sim_action.robot.documents.packages import Packages; from sim_action.core.workspace import Workspace;"
        f"root = Path({str(ros.root)!r}); packages = Packages(Workspace(root, root), {{}}, {{}});"
        f"check = XacroCheck(Path({str(ros.rover)!r}), [], packages); assert not check.problems;"
        "print([name for name in ('xacro', 'numpy', 'pybullet') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
