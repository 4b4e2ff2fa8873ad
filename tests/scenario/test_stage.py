"""What is told of a world in which something moves or is disturbed, and cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.robot.model.kinematics import link_poses
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from tests.ros_workspace import written
from tests.scenarios import load, told

HEAD = "name: s\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 10 s\nworld:\n"
OBJECTS = """\
  objects:
    - {name: ball, sphere: {radius: 5 cm}, mass: 1 kg, pose: {x: 2}}
    - {name: wall, box: [1, 1, 1], pose: {x: 3}}
    - {name: stone, sphere: {radius: 5 cm}, mass: 1 kg, pose: {x: 4}, appears: 3 s}
"""


def moving(points: str, more: str = "") -> str:
    return f"{HEAD}  objects:\n    - {{name: gate, box: [1, 1, 1], path: [{points}]{more}}}\n"


def disturbed(keys: str) -> str:
    return f"{HEAD}{OBJECTS}  disturbances:\n    - {{{keys}}}\n"


def test_what_can_be_is_let_through(tmp_path: Path) -> None:
    assert load(tmp_path, moving("{at: 0, x: 2}, {at: 1 s, x: 5}, {at: 20 s, x: 2}", ", loop: true"))
    assert load(tmp_path, moving("{at: 0}, {at: 6 ms, z: 1}"))
    for keys in (
        "at: 9.9 s, for: 0.1 s, force: [1, 0, 0]",
        "at: 1, for: 9 s, link: wheel_left_link, torque: [1, 0, 0]",
        "at: 0, velocity: [1, 0, 0], link: base_footprint",
        "at: 3 s, velocity: [1, 0, 0], body: stone",
        "at: 3 s, velocity: [200, 0, 0], body: stone",
        "at: 3 s, adhesion: 5 N, link: wheel_left_link",
        "at: 0, adhesion: 5 N, body: wall, for: 2 s",
    ):
        assert load(tmp_path, disturbed(keys)).scenario.world.disturbances


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (
            "{at: 1 s, x: 2}, {at: 1 s, x: 5}",
            "1.at: must be later than the point before it, at 1 s; a body cannot be at two places at the same time",
        ),
        (
            "{at: 0}, {at: 10 ms, x: 5}",
            "1: 5 m from 0 s on is 500 m/s, more than physics.max_speed, 100 m/s; it needs 0.05 s at least",
        ),
        (
            "{at: 0}, {at: 10 ms, yaw: 3600 deg}",
            (
                "1: 3600 deg from 0 s on is 3.6e+05 deg/s, more than physics.max_turn_rate, 5.73e+04 deg/s; "
                "it needs 0.063 s at least"
            ),
        ),
        (
            # It stands on the ground, with its middle at 0.5 m.
            "{at: 0}, {at: 10 ms, z: 2}",
            "1: 1.5 m from 0 s on is 150 m/s, more than physics.max_speed, 100 m/s; it needs 0.015 s at least",
        ),
        ("{at: 10 s}, {at: 11 s, x: 5}", "0.at: 10 s is not earlier than time_limit (10 s): the body never moves"),
        (
            "{at: 0}, {at: 10 s, x: 5}, {at: 12 s, x: 0}",
            "2.at: the run ends before the body gets there: time_limit is 10 s",
        ),
    ],
)
def test_motions_that_cannot_be(points: str, problem: str, tmp_path: Path) -> None:
    (line,) = told(tmp_path, moving(points))
    assert line.split(": ", 1)[1] == f"world.objects.0.path.{problem}"
    assert line.startswith("7:")


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("surface_velocity: {linear: 0.5}", "surface_velocity.linear: expected"),
        ("surface_velocity: {angular: 1 m/s}", "'m/s' is not a unit of angular speed"),
        ("surface_velocity: {speed: 1}", "surface_velocity.speed: unknown key"),
        ("surface_velocity: {linear: [1e9, 0, 0]}", "surface_velocity.linear.0: must be at most"),
        ("surface_velocity: {angular: .nan}", "surface_velocity.angular"),
        ("surface_velocity: {}", "a surface that does not move needs no 'surface_velocity'"),
        (
            "surface_velocity: {angular: 1}, mass: 1",
            "'surface_velocity' is of an object that is fixed from the start; remove 'mass'",
        ),
        ("surface_velocity: {angular: 1}, appears: 1 s", "remove 'appears'"),
        ("surface_velocity: {angular: 1}, disappears: 1 s", "remove 'disappears'"),
        ("surface_velocity: {angular: 1}, path: [{at: 0, x: 0}, {at: 1, x: 1}]", "remove 'path'"),
    ],
)
def test_belts_that_cannot_be(keys: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{HEAD}  objects:\n    - {{name: belt, box: [1, 1, 1], {keys}}}\n")
    assert problem in found
    assert found.startswith("7:")


def test_a_body_appears_before_the_end(tmp_path: Path) -> None:
    text = f"{HEAD}  objects:\n    - {{name: gate, box: [1, 1, 1], appears: 10 s}}\n"
    (found,) = told(tmp_path, text)
    assert found == "7:36: world.objects.0.appears: 10 s is not earlier than time_limit (10 s)"


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("at: 10 s, velocity: [1, 0, 0]", "at: 10 s is not earlier than time_limit (10 s)"),
        ("at: 9 s, for: 2 s, force: [1, 0, 0]", "for: it acts until 11 s, but the run ends at time_limit (10 s)"),
        (
            "at: 1, for: 1, link: base_foot, force: [1, 0, 0]",
            "link: the robot has no link 'base_foot'; did you mean 'base_footprint'?",
        ),
        ("at: 1, for: 1, link: ball, force: [1, 0, 0]", "link: the robot has no link 'ball'; say body: ball"),
        ("at: 1, for: 1, body: base_scan, force: [1, 0, 0]", "body: there is no body 'base_scan'; say link: base_scan"),
        ("at: 1, for: 1, body: bal, force: [1, 0, 0]", "body: there is no body 'bal'; did you mean 'ball'?"),
        (
            "at: 1, for: 1, body: wall, force: [1, 0, 0]",
            "body: body 'wall' is fixed whatever acts on it; only one with a 'mass' can be disturbed",
        ),
        ("at: 1, for: 1, body: stone, force: [1, 0, 0]", "at: body 'stone' is not there before it appears, at 3 s"),
        (
            "at: 1, adhesion: 5 N, link: imu_link",
            "link: the robot has no link 'imu_link' with a collision shape, so nothing touches it",
        ),
        ("at: 1, adhesion: 5 kg, link: base_link", "adhesion: 'kg' is not a unit of force"),
        ("at: 1, adhesion: -1 N, link: base_link", "adhesion: must be at least 0"),
        ("at: 1, adhesion: 5 N, body: stone", "at: body 'stone' is not there before it appears, at 3 s"),
        ("at: 1, velocity: [80, 80, 0]", "velocity: a push of 113.1 m/s is more than physics.max_speed, 100 m/s"),
        ("at: 1, velocity: [0, 0, 1e5]", "velocity.2: must be at most 10,000 m/s, found 100000.0"),
        ("at: 1, for: 1, force: [-1e11, 0, 0]", "force.0: must be at least -10,000,000,000 N, found -100000000000.0"),
        ("at: 1, for: 1, torque: [0, 1e300, 0]", "torque.1: must be at most 10,000,000,000 N m, found 1e+300"),
        ("at: 1, for: 1, force: [1, 0, 0], point: [0, 0, 1000 km]", "point.2: must be at most 100,000 m, found '1000"),
        (
            "at: 1, link: wheel_left_link, velocity: [1, 0, 0]",
            "link: a push of 'velocity' moves the robot as a whole; name its base link 'base_footprint', or give this",
        ),
    ],
)
def test_disturbances_that_cannot_be(keys: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, disturbed(keys))
    assert found.split(": ", 1)[1].startswith(f"world.disturbances.0.{problem}")


def test_nothing_moves_what_is_bolted(tmp_path: Path) -> None:
    text = disturbed("at: 1, for: 1, force: [1, 0, 0]").replace("burger}", "burger, base: fixed}")
    text += "allow: [fixed-base]\n"
    (found,) = told(tmp_path, text)
    assert found.endswith("link 'base_footprint' is fixed to the world, so nothing moves it")
    wheel = text.replace("for: 1,", "for: 1, link: wheel_left_link,")
    assert load(tmp_path, wheel)
    (found,) = told(tmp_path, wheel.replace("for: 1, ", "").replace("force", "velocity"))
    assert found.endswith("moves the robot as a whole; give the link a 'force' for a short time")


MOMENTS = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>"
CRATE = f"""<model name="crate"><pose>2 0 0.5 0 0 0</pose><link name="l"><inertial><mass>3</mass>{MOMENTS}</inertial>
<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model>"""
ROVER = f"""<model name="rover"><pose>1 2 0.1 0 0 1</pose>
<link name="base"><pose>0 0 0.1 0 0 0</pose><inertial><mass>2</mass>{MOMENTS}</inertial>
<collision name="c"><geometry><box><size>0.4 0.2 0.1</size></box></geometry></collision></link></model>"""
GROUND = "<include><uri>model://ground_plane</uri></include>"
ROBOT = "robot: {model: turtlebot3_burger}"


def loaded(folder: Path, inside: str, world: str = "", robot: str = ROBOT, more: str = "") -> LoadedScenario:
    (folder / "worlds").mkdir(exist_ok=True)
    text = f'<?xml version="1.0"?>\n<sdf version="1.9"><world name="w">\n{inside}\n</world></sdf>'
    (folder / "worlds/office.world").write_text(text)
    file = folder / "a.sim.yml"
    file.write_text(
        f"name: a\n{robot}\nworld: {{file: worlds/office.world{world}}}\nexpect: [upright]\ntime_limit: 1 s\n{more}"
    )
    return load_scenario(file)


def held(name: str, parent: str, child: str, kind: str = "revolute") -> str:
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}<axis><xyz>0 0 1</xyz></axis></joint>'


def problems(folder: Path, inside: str, world: str = "", robot: str = ROBOT) -> list[tuple[str, int | None, str]]:
    with pytest.raises(InvalidScenario) as error:
        loaded(folder, inside, world, robot)
    places = [(problem.location, problem.message) for problem in error.value.problems]
    return [(Path(place.file).name, place.line, message) for place, message in places]


def test_models_become_bodies_beside_the_objects_of_the_scenario(tmp_path: Path) -> None:
    found = loaded(tmp_path, GROUND + CRATE, ", objects: [{name: ball, sphere: {radius: 0.1}}]")
    assert [body.name for body in found.scenario.world.objects] == ["ball", "crate"]
    assert found.warnings == ()
    assert build_scene(found).world.objects[1].mass == 3


def test_gravity_and_ground_are_those_of_the_file_unless_the_scenario_states_them(tmp_path: Path) -> None:
    plane = "<collision name='c'><geometry><plane><normal>0 0 1</normal></plane></geometry>"
    rough = "<surface><friction><ode><mu>0.4</mu></ode></friction></surface></collision>"
    model = f"<model name='g'><static>1</static><link name='l'>{plane}{rough}</link></model>"
    inside = f"<gravity>0 0 -3.7</gravity>{model}"
    world = loaded(tmp_path, inside).scenario.world
    assert (world.gravity, world.ground.friction, world.objects) == ((0, 0, -3.7), 0.4, ())
    stated = loaded(tmp_path, inside, ", gravity: 1.6, ground: {friction: 0.9}").scenario.world
    assert (stated.gravity, stated.ground.friction) == ((0, 0, -1.6), 0.9)


@pytest.mark.parametrize("robot", ["", "robot: {}", "robot: {base: free}"])
def test_a_model_of_the_world_is_the_robot(robot: str, tmp_path: Path) -> None:
    found = loaded(tmp_path, GROUND + CRATE + ROVER, ", robot: rover", robot)
    assert found.model is not None
    assert (found.model.root, found.model.mass) == ("base", 2)
    at = found.scenario.robot.pose
    assert (at.x, at.y, at.z, at.yaw) == pytest.approx((1, 2, 0.2, 1))
    assert [body.name for body in found.scenario.world.objects] == ["crate"]
    assert found.warnings == ()


def test_a_pose_of_the_scenario_comes_before_that_of_the_file_and_the_robot_section_can_name_it(tmp_path: Path) -> None:
    found = loaded(tmp_path, GROUND + ROVER, ", robot: rover", "robot: {pose: {x: 7}}")
    assert (found.scenario.robot.pose.x, found.scenario.robot.pose.z) == (7, None)
    found = loaded(tmp_path, GROUND + ROVER, "", "robot: {model: 'worlds/office.world#rover', pose: {x: 5, z: 0}}")
    assert found.model is not None
    assert found.model.name == "rover"


def test_an_included_robot_has_the_pose_of_the_include(tmp_path: Path) -> None:
    model = tmp_path / "models/rover/model.sdf"
    model.parent.mkdir(parents=True)
    model.write_text(f'<sdf version="1.6">{ROVER}</sdf>')
    include = "<include><uri>model://rover</uri><name>one</name><pose>0 3 0 0 0 0</pose></include>"
    found = loaded(tmp_path, GROUND + include, ", robot: one", "")
    at = found.scenario.robot.pose
    assert (at.x, at.y, at.z) == pytest.approx((0, 3, 0.1))
    assert found.model is not None
    assert found.model.name == "one"


def test_a_wrong_name_has_the_nearest_ones_and_the_same_name_twice_is_an_error(tmp_path: Path) -> None:
    ((file, line, message),) = problems(tmp_path, GROUND + CRATE + ROVER, ", robot: rovr", "")
    assert (file, line) == ("a.sim.yml", 3)
    assert message.startswith("world.robot: worlds/office.world has no model 'rovr'; did you mean 'rover'?")
    twice = problems(tmp_path, GROUND + CRATE, ", objects: [{name: crate, sphere: {radius: 1}}]")
    message = "worlds/office.world has a body 'crate', too; names are unique: give this one another name"
    assert twice == [("a.sim.yml", 3, f"world.objects.0.name: {message}")]


@pytest.mark.parametrize(
    ("inside", "line", "message"),
    [
        (CRATE.replace("<size>1 1 1", "<size>1 1"), 4, "<size> is '1 1': expected 3 finite numbers"),
        ("<model name='m'>", 4, "not well-formed XML"),
        ("<include><uri>model://house</uri></include>", 3, "the model 'house', which was not found"),
        ("<include><uri>../../../etc/passwd</uri></include>", 3, "is outside the workspace"),
        (CRATE.replace("<box><size>1 1 1</size></box>", "<mesh><uri>a.obj</uri></mesh>"), 4, "[incomplete-world]"),
    ],
)
def test_a_problem_of_the_file_has_its_line(inside: str, line: int, message: str, tmp_path: Path) -> None:
    found = problems(tmp_path, inside)
    assert [each[:2] for each in found] == [("office.world", line)]
    assert message in found[0][2]


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ("file: worlds/none.world", "'worlds/none.world' does not exist"),
        ("file: ../a.world", "is outside the workspace"),
        ("file: worlds/Ofice.world", r"does not exist .*; did you mean 'office\.world'\?"),
        ("robot: rover", "'robot' names a model of a world file: add 'file'"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(world: str, message: str, tmp_path: Path) -> None:
    loaded(tmp_path, GROUND)
    (tmp_path.parent / "a.world").write_text("<sdf/>")
    file = tmp_path / "a.sim.yml"
    file.write_text(f"name: a\n{ROBOT}\nworld: {{{world}}}\nexpect: [upright]\ntime_limit: 1 s\n")
    with pytest.raises(InvalidScenario, match=message):
        load_scenario(file)


def test_a_second_model_of_a_name_gets_a_number(tmp_path: Path) -> None:
    found = loaded(tmp_path, GROUND + CRATE + "\n" + CRATE.replace("2 0 0.5", "4 0 0.5"))
    assert [(body.name, body.pose.x) for body in found.scenario.world.objects] == [("crate", 2), ("crate_1", 4)]
    (warning,) = found.warnings
    assert (warning.location.line, warning.message[:24]) == (5, "a second model 'crate' h")


def test_a_model_that_is_not_found_can_be_allowed(tmp_path: Path) -> None:
    inside = GROUND + "<include><uri>model://house</uri></include>"
    (warning,) = loaded(tmp_path, inside, more="allow: [incomplete-world]").warnings
    assert warning.rule == "incomplete-world"
    # A world without a ground plane is noted.
    (warning,) = loaded(tmp_path, CRATE).warnings
    assert "has no ground plane" in warning.message


def test_a_model_that_is_missing_many_times_is_one_problem(tmp_path: Path) -> None:
    includes = [f"<include><uri>model://house</uri><name>h{number}</name></include>" for number in range(12)]
    found = problems(tmp_path, GROUND + "\n".join([*includes, "<include><uri>model://tree</uri></include>"]))
    assert [(file, line) for file, line, _ in found] == [("office.world", 3), ("office.world", 15)]
    assert "12 times, also at " in found[0][2]
    assert "office.world:6 and 8 more; to run without it" in found[0][2]
    assert " times, also" not in found[1][2]


def test_a_robot_besides_that_of_the_world_is_an_error(tmp_path: Path) -> None:
    found = problems(tmp_path, GROUND + ROVER, ", robot: rover")
    message = (
        "robot.model: world.robot makes 'rover' of worlds/office.world the robot; remove robot.model or world.robot"
    )
    assert found == [("a.sim.yml", 2, message)]
    same = "robot: {model: 'worlds/office.world#rover'}"
    assert loaded(tmp_path, GROUND + ROVER, ", robot: rover", same).model is not None


def test_each_kind_of_loss_is_one_note(tmp_path: Path) -> None:
    actors = "<actor name='a'/>\n<actor name='b'/>\n<plugin filename='libsky.so' name='s'/>"
    times = "2 times in the world; this is the first"
    notes = [(warning.location.line, str(warning)) for warning in loaded(tmp_path, GROUND + actors).warnings]
    assert notes == [
        (3, f"<actor> is not simulated: nothing can touch or see it ({times}) [not-simulated]"),
        (5, "the plugin sky of the world is not supported and has no effect [not-simulated]"),
    ]
    assert loaded(tmp_path, GROUND + actors, more="allow: [not-simulated]").warnings == ()


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (held("j", "crate", "rover", "fixed"), "the models are not joined"),
        (GROUND.replace("</uri>", "</uri><pose>0 0 1 0 0 0</pose>"), "the <pose> of the ground plane is not simulated"),
        (GROUND.replace("</uri>", "</uri><pose>5 0 0 0 0 1</pose>"), ""),
        ("</world><world name='two'>", "only the first <world> is read; 'two' is ignored"),
    ],
)
def test_a_part_of_the_world_that_is_left_out_is_noted(inside: str, message: str, tmp_path: Path) -> None:
    found = [warning.message for warning in loaded(tmp_path, GROUND + CRATE + ROVER + inside).warnings]
    assert len(found) == (1 if message else 0)
    assert all(message in each for each in found)


def test_a_model_that_is_merged_into_the_world_is_missing(tmp_path: Path) -> None:
    written(tmp_path / "models/crate/model.sdf", f'<sdf version="1.9">{CRATE}</sdf>')
    include = '<include merge="true"><uri>model://crate</uri></include>'
    ((_, line, message),) = problems(tmp_path, GROUND + include)
    assert line == 3
    assert "its model is missing: remove 'merge'" in message


def robot_link(name: str, z: float) -> str:
    inertial = "<inertial><mass>2</mass></inertial>"
    ball = "<collision name='c'><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>"
    return f'<link name="{name}"><pose>0 0 {z} 0 0 0</pose>{inertial}{ball}</link>'


ARM, BASE, TURN = robot_link("arm", 0.7), robot_link("base", 0.4), held("turn", "base", "arm")
TIP = '<frame name="tip" attached_to="arm"/>'
INNER = f'<model name="in"><pose>0 0 1 0 0 0</pose>{ARM}{robot_link("mid", 0)}{held("j", "mid", "arm")}</model>'


@pytest.mark.parametrize(
    "inside",
    [
        ARM + BASE + TURN,
        ARM + BASE + TIP + held("turn", "base", "tip"),
        INNER + BASE + held("mount", "base", "in::mid", "fixed"),
        f'<model name="in">{ARM}</model>' + BASE + held("mount", "base", "in"),
    ],
    ids=["second-link", "frame-as-child", "joint-in-a-nested-model", "model-as-child"],
)
def test_the_robot_starts_where_its_root_link_is(inside: str, tmp_path: Path) -> None:
    robot = f'<model name="r"><pose>2 1 0.5 0 0 0</pose>{inside}</model>'
    found = loaded(tmp_path, GROUND + robot, ", robot: r", "")
    assert found.model is not None
    assert found.model.root == "base"
    at = found.scenario.robot.pose
    assert (at.x, at.y, at.z) == pytest.approx((2, 1, 0.9))


@pytest.mark.parametrize("static", [False, True])
def test_a_robot_that_is_joined_to_the_world_stays_at_its_place_in_the_file(static: bool, tmp_path: Path) -> None:
    hold = "<static>1</static>" if static else held("hold", "world", "base", "fixed")
    robot = f'<model name="r"><pose>2 1 0.5 0 0 0</pose>{ARM}{BASE}{TURN}{hold}</model>'
    found = loaded(tmp_path, GROUND + robot, ", robot: r", "", "allow: [fixed-base]")
    assert found.model is not None
    assert link_poses(found.model, {})["base"].position_xyz == pytest.approx((2, 1, 0.9))
    at = found.scenario.robot.pose
    assert (found.model.root, at.x, at.y, at.yaw) == ("world", 0, 0, 0)


@pytest.mark.parametrize(
    ("attribute", "tag"),
    [("", "<placement_frame>arm</placement_frame>"), (' placement_frame="arm"', "")],
    ids=["include", "model"],
)
def test_a_placement_frame_counts_once(attribute: str, tag: str, tmp_path: Path) -> None:
    inside = f'<model name="rover"{attribute}>{ARM}{BASE}{TURN}{held("hold", "world", "base", "fixed")}</model>'
    written(tmp_path / "models/rover/model.sdf", f'<sdf version="1.9">{inside}</sdf>')
    include = f"<include><uri>model://rover</uri><name>r</name>{tag}<pose>2 1 1.5 0 0 0</pose></include>"
    found = loaded(tmp_path, GROUND + include, ", robot: r", "", "allow: [fixed-base]")
    assert found.model is not None
    poses = link_poses(found.model, {})
    assert poses["arm"].position_xyz == pytest.approx((2, 1, 1.5))
    assert poses["base"].position_xyz == pytest.approx((2, 1, 1.2))
