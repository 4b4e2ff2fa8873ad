"""From what a scenario names to a robot model."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, ModelError, RefusedModel
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.robot.built_in import BUILT_IN
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import ModelLibrary, load_model, package_problems
from sim_action.scenario.loading import load_scenario
from tests.robot.bad_models import GOOD
from tests.ros_workspace import NAMESPACE, TRIANGLE, written

NAMES = ", ".join(sorted(BUILT_IN))
SDF = """<sdf version="1.9"><model name="box"><link name="base"><inertial><mass>1</mass>
<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link></model></sdf>"""


@pytest.mark.parametrize("name", ["box.sdf", "box.world", "box.urdf"])
def test_sdf_is_known_by_what_is_in_the_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(SDF)
    assert load_model(Robot(model=name), Workspace(tmp_path, tmp_path)).root == "base"


def test_sdf_is_made_by_xacro(tmp_path: Path) -> None:
    made = SDF.replace("<sdf", '<sdf xmlns:xacro="http://www.ros.org/wiki/xacro"').replace(
        "<mass>1", '<xacro:arg name="mass" default="1"/><mass>$(arg mass)'
    )
    (tmp_path / "box.sdf.xacro").write_text(made)
    robot = Robot(model="box.sdf.xacro", args={"mass": 2.5})
    assert load_model(robot, Workspace(tmp_path, tmp_path)).mass == 2.5


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("turtlebot3", "unknown robot 'turtlebot3'; did you mean 'turtlebot3_burger'?"),
        ("zzz", f"unknown robot 'zzz' (allowed: {NAMES}), or the path of a .urdf, .xacro, .sdf or .xml file"),
        ("package://a/b.urdf", "the package 'a' was not found"),
        ("absent.xacro", "'absent.xacro' does not exist"),
        ("absent.urdf", "'absent.urdf' does not exist"),
        ("../box.urdf", "is outside the workspace"),
        (".", "'.' is a folder"),
        ("a\0.urdf", "is not a valid path"),
        ("model://absent", "the model 'absent' was not found"),
        ("model://", "names no file"),
        ("ant.xml", "a robot must be one body with its children, but the model has 0 bodies in its world"),
        ("robot.sdf", "the root element of a URDF is <robot>, but this file has <model>"),
    ],
)
def test_what_is_no_model_is_told_with_what_would_be(name: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "ant.xml").write_text("<mujoco/>")
    (tmp_path / "robot.sdf").write_text("<model/>")
    with pytest.raises(ModelError) as raised:
        load_model(Robot(model=name), Workspace(tmp_path, tmp_path))
    assert message in str(raised.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Box.urdf", "; did you mean 'box.urdf'?"),
        ("bix.urdf", "; did you mean 'box.urdf'?"),
        ("two_arms", "the model files in it are: arms.xml, hand.xml; write 'model: two_arms/arms.xml'"),
        ("./two_arms/", "write 'model: ./two_arms/arms.xml'"),
        ("deep", "the model files in it are: urdf/a.urdf, urdf/b.xacro; write 'model: deep/urdf/a.urdf'"),
        ("empty", "'empty' is a folder, not a file"),
    ],
)
def test_a_near_name_and_a_folder_lead_to_the_file(name: str, message: str, tmp_path: Path) -> None:
    files = ("box.urdf", "two_arms/hand.xml", "two_arms/arms.xml", "two_arms/package.xml", "two_arms/x.stl")
    for file in (*files, "deep/urdf/a.urdf", "deep/urdf/b.xacro", "empty/x.stl"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text("")
    with pytest.raises(ModelError) as raised:
        load_model(Robot(model=name), Workspace(tmp_path, tmp_path))
    assert message in str(raised.value)


def test_a_key_of_packages_that_leads_to_no_folder_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    robot = Robot(model="box.urdf", packages={"a": "there", "b": "nope"})
    ((path, message),) = package_problems(robot, Workspace(tmp_path, tmp_path))
    assert path == ("robot", "packages", "b")
    assert message == f"'b: nope' in robot.packages is not a folder (looked for {tmp_path / 'nope'})"


def test_of_many_findings_the_first_of_each_rule_are_notes(tmp_path: Path) -> None:
    tags = '<gazebo reference="nope"/>' * 5_000
    link = '<link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{link}</inertial></link>\n{tags}</robot>')
    model = load_model(Robot(model="robot.urdf"), Workspace(tmp_path, tmp_path))
    of_rule = [finding for finding in model.findings if finding.rule == "unknown-reference"]
    assert len(of_rule) == 101
    assert of_rule[-1].message.startswith("4,900 more problems like these")
    assert (of_rule[-1].level, of_rule[-1].location.line) == ("warning", 2)
    assert [finding.rule for finding in model.findings].count("no-collision-shape") == 1


def read(library: ModelLibrary, root: Path, folder: str, **robot: object) -> RobotModel:
    (root / folder).mkdir(exist_ok=True)
    return library.load(Robot.model_validate(robot), Workspace(root / folder, root))


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    for name in ("arm", "other"):
        (tmp_path / f"{name}.urdf").write_text(GOOD)
    return tmp_path


def test_a_file_is_read_once_wherever_it_is_seen_from(workspace: Path) -> None:
    library = ModelLibrary()
    first = read(library, workspace, "a", model="../arm.urdf")
    (workspace / "arm.urdf").write_text("broken")
    assert read(library, workspace, "a", model="../arm.urdf") is first
    assert read(library, workspace, "b", model="../b/../arm.urdf", pose={"x": 1}, base="fixed") is first
    with pytest.raises(ModelError):
        read(ModelLibrary(), workspace, "a", model="../arm.urdf")
    burger = read(library, workspace, "a", model="turtlebot3_burger")
    assert read(library, workspace, "b", model="turtlebot3_burger") is burger


def test_what_is_read_in_another_way_is_another_model(workspace: Path) -> None:
    library = ModelLibrary()
    ways: list[dict[str, object]] = [
        {"model": "../arm.urdf"},
        {"model": "../other.urdf"},
        {"model": "../arm.urdf", "allow": ("zero-mass",)},
        {"model": "../arm.urdf", "packages": {"p": "."}},
    ]
    models = [read(library, workspace, "a", **way) for way in ways]
    # A package is looked for from the scenario's own folder.
    models.append(read(library, workspace, "b", **ways[-1]))
    assert len({id(model) for model in models}) == len(models)


def test_another_workspace_admits_other_files(workspace: Path) -> None:
    library = ModelLibrary()
    robot = Robot(model=str(workspace / "arm.urdf"))
    (workspace / "a").mkdir()
    library.load(robot, Workspace(workspace, workspace))
    with pytest.raises(ModelError, match="outside the workspace"):
        library.load(robot, Workspace(workspace / "a", workspace / "a"))


def test_what_cannot_be_read_is_told_and_not_read_again(workspace: Path) -> None:
    library = ModelLibrary()
    for model in ("nosuch.urdf", "nosuch", "a\0b.urdf", "nosuch://a/b", "x" * 300 + ".urdf") * 2:
        with pytest.raises(ModelError):
            read(library, workspace, "a", model=model)
    (workspace / "arm.urdf").write_text("broken")
    errors = list[ModelError]()
    for folder in ("a", "b", "a"):
        with pytest.raises(ModelError) as raised:
            read(library, workspace, folder, model="../arm.urdf")
        errors.append(raised.value)
        (workspace / "arm.urdf").write_text(GOOD)
    assert errors[0] is errors[1] is errors[2]
    assert read(ModelLibrary(), workspace, "a", model="../arm.urdf").root == "base"
    # An error that is kept keeps nothing of what was read.
    library = ModelLibrary()
    (workspace / "arm.urdf").write_text("<robot>")
    depths = set[int]()
    for _ in range(3):
        with pytest.raises(ModelError) as raised:
            read(library, workspace, "a", model="../arm.urdf")
        assert raised.value.__context__ is None
        depths.add(len(raised.traceback))
    assert len(depths) == 1


MODEL = """\
<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2"/>
  <link name="base">
    <inertial>
      <mass value="$(arg mass)"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="${2 / 2}"/>
    </inertial>
  </link>
</robot>
"""
SCENARIO = """\
name: n
robot: {model: bot.urdf.xacro}
expect: [{joint: {name: elbow, at_most: 1}}]
time_limit: 1 s
"""


def robot(folder: Path, text: str = MODEL, **keys: object) -> Robot:
    (folder / "bot.urdf.xacro").write_text(text)
    return Robot.model_validate({"model": "bot.urdf.xacro", **keys})


def refusal(folder: Path, text: str, **keys: object) -> str:
    with pytest.raises(RefusedModel) as refused:
        load_model(robot(folder, text, **keys), Workspace(folder, folder))
    return str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "line", "rule"),
    [
        ("${2 / 2}", "${whatever}", 6, "bad-xacro"),
        ("${2 / 2}", "${-2}", 6, "impossible-inertia"),
        ('value="$(arg mass)"', "", 5, "missing-part"),
        ('default="2"/>', 'default="2"/><xacro:include filename="$(find absent)/a.xacro"/>', 2, "missing-package"),
    ],
)
def test_what_is_wrong_is_told_on_the_line_of_the_xacro_file(
    old: str, new: str, line: int, rule: str, tmp_path: Path
) -> None:
    assert old in MODEL
    message = refusal(tmp_path, MODEL.replace(old, new))
    assert message.startswith(f"{tmp_path}/bot.urdf.xacro:{line}:")
    assert message.endswith(f"[{rule}]")
    assert message.count("bot.urdf.xacro:") == 1


def test_a_scenario_says_what_was_left_unchecked_and_checks_it_where_it_runs(tmp_path: Path) -> None:
    robot(tmp_path)
    path = tmp_path / "s.sim.yml"
    path.write_text(SCENARIO)
    loaded = load_scenario(path)
    assert loaded.scenario.runs_user_code
    assert "links and joints: " in loaded.unchecked[0]
    assert len(loaded.unchecked) == 1
    with pytest.raises(InvalidScenario, match="no moving joint 'elbow'"):
        load_scenario(path, evaluate=True)
    with pytest.raises(InvalidScenario, match=r"s\.sim\.yml:2:9: robot\.model: no scripts here"):
        load_scenario(path, Permissions(scripts_refused="no scripts here"))


def test_a_package_that_includes_and_meshes_need_has_one_note(tmp_path: Path) -> None:
    root = tmp_path.resolve()
    written(root / "hand/link.xacro", f'<robot {NAMESPACE}><xacro:property name="radius" value="1"/></robot>')
    written(root / "hand/a.stl", TRIANGLE)
    shape = '<visual><geometry><mesh filename="package://hand/a.stl"/></geometry></visual>'
    text = f'<xacro:include filename="$(find hand)/link.xacro"/><link name="base">{shape}</link>'
    written(root / "arm/arm.urdf.xacro", f'<robot name="arm" {NAMESPACE}>{text}</robot>')
    robot = Robot(model="arm/arm.urdf.xacro", allow=("massless-model",))
    notes = [found for found in load_model(robot, Workspace(root, root)).findings if found.rule == "package-folder"]
    assert len(notes) == 1
    assert "hand is used, a folder of that name" in notes[0].message


@pytest.mark.parametrize("stated", ["<selfCollide>true</selfCollide>", "<self_collide>1</self_collide>"])
def test_links_that_collide_in_gazebo_name_the_key_of_the_scenario(stated: str, tmp_path: Path) -> None:
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="a"><inertial><mass value="1"/>{inertia}</inertial></link>'
    (tmp_path / "a.urdf").write_text(f'<robot name="r">{link}<gazebo reference="a">{stated}</gazebo></robot>')
    here = Workspace(tmp_path, tmp_path)
    (found,) = [each for each in load_model(Robot(model="a.urdf"), here).findings if each.rule == "passed-over"]
    assert "is not simulated; it is ignored: links of a robot" in found.message
    assert found.message.endswith("; robot.self_collision: true simulates it")
    left = load_model(Robot(model="a.urdf", self_collision=True), here).findings
    assert "passed-over" not in {each.rule for each in left}
