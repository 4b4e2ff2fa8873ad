"""The other robots of a world: one clock, one engine, contacts between all."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import BadStart, InvalidScenario, MissedContact, ScriptError, SimulationUnstable
from sim_action.core.geometry import Pose, compose
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.recording.export.mcap_log import topics
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2_messages import Frames
from sim_action.recording.replay.build import replay_of
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder
from tests.simulated import simulated as run

ENGINES = ("pybullet", "mujoco")

# The nose of the burger is its wheels' or base's foremost point; the oracle measures where it meets a wall.
RATE = 240
SPEED = 0.2
RAMP = 1.0


DRIVES = f"{{twist: [{{linear: {SPEED}, for: 9 s}}]}}"


def actor(name: str = "oncoming", x: float = 2.0, yaw: int = 180, commands: str = DRIVES, more: str = "") -> str:
    driven = f", commands: {commands}" if commands else ""
    return f"{{name: {name}, model: turtlebot3_burger, pose: {{x: {x}, yaw: {yaw} deg}}{driven}{more}}}"


def written(actors: str, expect: str, *, engine: str = "auto", commands: str = DRIVES) -> str:
    return f"""
name: two robots
robot: {{model: turtlebot3_burger}}
backend: {engine}
world:
  actors: [{actors}]
{f"commands: {commands}" if commands else ""}
expect: {expect}
time_limit: 9 s
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_two_robots_meet_at_the_step_that_arithmetic_says(tmp_path: Path, engine: str) -> None:
    """One robot against a wall, and two against each other: each drives half of the way, in the same time."""
    wall = "{name: wall, box: [0.1, 1, 0.3], pose: {x: 1.05}}"
    text = written(actor(), "[{contact: {with: wall}}]", engine=engine)
    alone = run(tmp_path, text.replace(f"actors: [{actor()}]", f"objects: [{wall}]"))
    both = run(tmp_path, written(actor(), "[{contact: {with: oncoming}}]", engine=engine))
    touched, met = (verdict.time for verdict in (alone.verdicts[0], both.verdicts[0]))
    assert touched is not None
    assert met == pytest.approx(touched, abs=2 / RATE)
    # The way from the start to the wall, with a ramp of 1 m/s^2 up to the speed.
    reach = float(alone.trace.base_position_xyz[-1, 0])
    assert met == pytest.approx(reach / SPEED + SPEED / RAMP / 2, abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pushed_robot_moves_as_its_mass_says(tmp_path: Path, engine: str) -> None:
    """Without gravity, a force at the centre of mass of a robot accelerates it by its whole mass."""
    rest = actor("floating", 3.0, 0, "").replace("pose: {x: 3.0,", "pose: {x: 3.0, z: 2,")
    text = written(rest, "[{object: {name: floating, moved: {at_most: 9 m}}}]", engine=engine, commands="")
    model = load_model(Robot(model="turtlebot3_burger"), Workspace(tmp_path, tmp_path))
    x, y, z = _centre_of_mass(model)
    push = f"[{{at: 0.5 s, for: 0.5 s, body: floating, force: [0.4, 0, 0], point: [{x}, {y}, {z}]}}]"
    world = f"world:\n  gravity: 0\n  disturbances: {push}"
    ended = run(tmp_path, text.replace("world:", world).replace("9 s", "1.5 s"))
    away = 0.4 / model.mass * (0.5 * 0.5**2 + 0.5 * 0.5)
    assert ended.verdicts[0].measured == pytest.approx(away, rel=0.01)


def _centre_of_mass(model: RobotModel) -> tuple[float, ...]:
    poses = link_poses(model, model.positions({}))
    parts = [(link.mass or 0.0, compose(poses[link.name], Pose(link.centre_of_mass_xyz))) for link in model.links]
    return tuple(sum(mass * at.position_xyz[axis] for mass, at in parts) / model.mass for axis in range(3))


@pytest.mark.parametrize("engine", ENGINES)
def test_names_and_far_robots_change_nothing(tmp_path: Path, engine: str) -> None:
    left, right = (("left", 3.0), ("right", -3.0))
    expect = "[{travel: {at_least: 0.5 m}}, no_collision]"
    several = [
        ", ".join(actor(name, x, 90) for (name, _), (_, x) in zip(names, (left, right), strict=True))
        for names in ((left, right), (right, left))
    ]
    digests = {run(tmp_path, written(text, expect, engine=engine)).digest for text in several}
    far = {run(tmp_path, written(actor("far", x), expect, engine=engine)).digest for x in (50.0, 80.0)}
    alone = written("", expect, engine=engine).replace("no_collision", "upright")
    assert len(digests | far | {run(tmp_path, alone).digest}) == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_expectations_name_a_robot_and_its_links(tmp_path: Path, engine: str) -> None:
    goals = """
  - clearance: {to: [oncoming], at_least: 1 m}
  - object: {name: oncoming/wheel_left_link, moved: {at_least: 0.2 m}}
  - object: {name: oncoming, reach: {x: 1.5, y: 0, tolerance: 5 cm}}
  - object: {name: oncoming, upright: {}}
  - no_collision
  - stl: always clearance(oncoming) > 1 m"""
    ended = run(tmp_path, written(actor(), goals, engine=engine, commands=""))
    assert [verdict.message for verdict in ended.verdicts if not verdict.passed] == []


@pytest.mark.parametrize("engine", ENGINES)
def test_every_source_commands_its_own_robot(tmp_path: Path, engine: str) -> None:
    (tmp_path / "turn.py").write_text(
        "from sim_action import Twist\ndef drive(seen):\n    assert seen.pose.position_xyz[0] < -1\n"
        "    return Twist((0.1, 0, 0), (0, 0, 0))\n",
        encoding="utf-8",
    )
    actors = [
        actor("follower", 1.0, 0, "{waypoints: [{x: 1.4, y: 0.4}]}"),
        actor("scripted", -2.0, 0, "{script: turn.py, function: drive}"),
        actor("turned", 4.0, 0, "{joints: [{at: 0 s, velocity: {wheel_left_joint: 2, wheel_right_joint: -2}}]}"),
    ]
    goals = """
  - object: {name: follower, reach: {x: 1.4, y: 0.4, tolerance: 5 cm}}
  - object: {name: scripted, reach: {x: -1.5, y: 0, tolerance: 5 cm}}
  - stl: eventually turned.yaw < -1 rad
  - stl: always (abs(turned.x - 4 m) < 5 cm and speed < 1 cm/s)"""
    ended = run(tmp_path, written(", ".join(actors), goals, engine=engine, commands=""))
    assert [verdict.message for verdict in ended.verdicts if not verdict.passed] == []


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_that_explodes_is_named(tmp_path: Path, engine: str) -> None:
    push = "  disturbances: [{at: 0.1 s, body: oncoming, velocity: [29, 0, 0]}]\nphysics: {max_speed: 2 m/s}"
    text = written(actor(), "[no_collision]", engine=engine, commands="").replace("\nexpect", f"{push}\nexpect")
    with pytest.raises(SimulationUnstable, match=r"'oncoming': simulation unstable at t = 0.10\d s") as unstable:
        run(tmp_path, text)
    assert unstable.value.keys == ("world", "actors", 0, "model")


def test_a_script_that_fails_names_its_robot(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("def drive(seen):\n    raise ValueError('boom')\n", encoding="utf-8")
    text = written(actor(commands="{script: bad.py, function: drive}"), "[no_collision]", commands="")
    with pytest.raises(ScriptError, match=r"^at 0 s of sim time, 'oncoming': .* ValueError: boom") as failed:
        run(tmp_path, text)
    assert (failed.value.actor, failed.value.source) == (0, 0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_that_passes_through_a_wall_is_named(tmp_path: Path, engine: str) -> None:
    wall = "  objects: [{name: wall, box: [0.01, 4, 2], pose: {x: 3}}]"
    push = "  disturbances: [{at: 0.1 s, body: oncoming, velocity: [60, 0, 0]}]"
    text = written(actor(), "[max_speed: {linear: 1 m/s}]", engine=engine, commands="")
    with pytest.raises(MissedContact, match=r"'oncoming': link '\w+' passed through .*wall"):
        run(tmp_path, text.replace("\nexpect", f"{wall}\n{push}\nexpect"))


CRATE = "  objects: [{name: crate, box: [0.1, 0.1, 0.1], pose: {x: 1.5}, mass: 1}]\n"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("pushed", "who", "through"),
    [
        ("{body: oncoming, velocity: [-60, 0, 0]}", "link", "oncoming/"),
        ("{body: oncoming, velocity: [60, 0, 0]}", "'oncoming': link", "third/"),
        ("{velocity: [60, 0, 0]}", "link", "oncoming/"),
        ("{body: oncoming, velocity: [-60, 0, 0]}", "'oncoming': link", "crate"),
    ],
)
def test_robots_that_pass_through_each_other_are_named(
    tmp_path: Path, engine: str, pushed: str, who: str, through: str
) -> None:
    """Half a metre in a step, from one side of the other robot to the other."""
    push = f"  disturbances: [{pushed.replace('{', '{at: 0.1 s, ')}]\nphysics: {{rate: 120 Hz, max_turn_rate: 9000}}"
    actors = f"{actor(x=2.25, commands='')}, {actor('third', 4.5, commands='')}"
    text = written(actors, "[upright]", engine=engine, commands="")
    world = f"{CRATE if through == 'crate' else ''}{push}"
    with pytest.raises(MissedContact, match=rf"^{who} '\w+' passed through body '{through}\w*' without a contact"):
        run(tmp_path, text.replace("\nexpect", f"{world}\nexpect"))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_that_starts_inside_another_is_refused(tmp_path: Path, engine: str) -> None:
    inside = actor("inner", 0.05)
    with pytest.raises(BadStart, match=r"inside 'inner'; move it, or world.actors\[0\].pose"):
        run(tmp_path, written(inside, "[no_collision]", engine=engine))
    two = f"{actor('one', 2.0)}, {actor('other', 2.05)}"
    with pytest.raises(BadStart, match=r"begins .* deep in '(one|other)'") as refused:
        run(tmp_path, written(two, "[no_collision]", engine=engine))
    assert {path[:2] for path, _ in refused.value.by_keys} == {("world", "actors")}


@pytest.mark.parametrize(
    ("actors", "message"),
    [
        (
            f"{actor('a')}, {actor('a', 3)}",
            "world.actors.1.name: 'a' is already the name of a body or of another robot",
        ),
        (actor("robot"), "world.actors.0.name: 'robot' is the robot under test; give this one another name"),
        (actor("a/b"), "world.actors.0.name: "),
        (", ".join(actor(f"r{n}", n) for n in range(2, 23)), "world.actors: "),
        (actor(commands="{twist: [{linaer: 1}]}"), "world.actors.0.commands.twist.0.linaer: unknown key"),
        (actor(more=", drive: {diff: {left: [x], right: [y]}}"), "world.actors.0.drive.diff"),
        (actor(more=", joints: {wheel: 1}"), "world.actors.0.joints.wheel: "),
        (actor(more=", sensors: [{lidar: {}, link: mast}]"), "world.actors.0.sensors.0"),
        (actor(commands="{joints: [{at: 1 s, position: {arm: 1}}]}"), "world.actors.0.commands.joints"),
        (actor().replace("turtlebot3_burger", "no.urdf"), "world.actors.0.model: "),
        pytest.param(
            actor(commands="{ros1: {nodes: [./a.py]}}"),
            "world.actors.0.commands: 'ros1' drives only the robot under test; ",
            marks=pytest.mark.process,
        ),
    ],
)
def test_a_wrong_robot_is_refused_at_its_place(tmp_path: Path, actors: str, message: str) -> None:
    path = tmp_path / "a.sim.yml"
    (tmp_path / "a.py").touch()
    path.write_text(written(actors, "[no_collision]"), encoding="utf-8")
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(path)
    assert [problem.message for problem in refused.value.problems if message in problem.message], refused.value


def test_the_roles_turn_round_with_one_word(tmp_path: Path) -> None:
    """The former robot takes the place and the name of the other, and problems name where keys are written."""
    expect = "[{object: {name: oncoming, moved: {at_least: 0.5 m}}}]"
    more = ", sensors: [{imu: {}}]"
    (tmp_path / "first.sim.yml").write_text(written(actor(more=more), expect, commands=""), encoding="utf-8")
    second = tmp_path / "second.sim.yml"
    second.write_text("extends: first.sim.yml\nego: oncoming\nname: turned\nexpect: [{travel: {at_least: 0.5 m}}]\n")
    loaded = load_scenario(second)
    (former,) = loaded.scenario.world.actors
    assert (loaded.scenario.robot.pose.x, former.pose.x, former.name) == (2.0, 0.0, "oncoming")
    assert (len(loaded.scenario.commands), len(former.commands)) == (1, 0)
    assert [mounted.name for mounted in loaded.scenario.sensors] == ["imu"]
    ended = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    assert [verdict.passed for verdict in ended.verdicts] == [True]
    second.write_text("extends: first.sim.yml\nego: oncomin\n")
    with pytest.raises(InvalidScenario, match=r"second.sim.yml:2:1: ego: there is no robot 'oncomin' .* 'oncoming'"):
        load_scenario(second)
    second.write_text("extends: first.sim.yml\nego: 3\n")
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(second)
    assert len(refused.value.problems) == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_sensors_of_each_robot_see_the_others_and_not_itself(tmp_path: Path, engine: str) -> None:
    (tmp_path / "look.py").write_text(
        "def drive(seen):\n    ranges = seen.sensors['lidar'].ranges\n    ahead = min(ranges)\n"
        "    assert 1.9 < ahead < 2.1, ahead\n    assert 1.9 < seen.sensors['camera'].depth[24, 32] < 2.1\n",
        encoding="utf-8",
    )
    below = "link: base_scan, pose: {z: -0.01}"
    sensors = f"[{{lidar: {{}}, {below}}}, {{camera: {{width: 64, height: 48}}, {below}}}]"
    both = written(
        actor(commands="{script: look.py, function: drive}", more=f", sensors: {sensors}"),
        "[{sensor: {name: lidar, reading: ranges, which: min, at_least: 1.9 m, at_most: 2.1 m}}]",
        engine=engine,
        commands="{script: look.py, function: drive}",
    )
    ended = run(tmp_path, f"{both}\nsensors: {sensors}".replace("9 s", "0.5 s"))
    assert [verdict.passed for verdict in ended.verdicts] == [True], ended.verdicts


@pytest.mark.parametrize("engine", ENGINES)
def test_all_robots_are_at_rest_at_the_start(tmp_path: Path, engine: str) -> None:
    high = actor("high", 3.0, 0, "").replace("pose: {", "pose: {z: 0.3, ")
    still = "[{object: {name: high, moved: {at_most: 5 mm}}}]"
    ended = run(tmp_path, written(high, still, engine=engine, commands="").replace("9 s", "0.5 s"))
    assert ended.verdicts[0].passed
    assert [note[:26] for note in ended.notes] == ["'high': the robot fell 0.3"]


def test_each_robot_draws_its_own_random_numbers(tmp_path: Path) -> None:
    path = tmp_path / "two.sim.yml"
    path.write_text(written(f"{actor('left')}, {actor('right', 3.0)}", "[upright]"), encoding="utf-8")
    scene = build_scene(load_scenario(path))
    assert len({robot.generator("sensor lidar").random() for robot in (scene, *scene.actors.values())}) == 3


@pytest.mark.parametrize("engine", ENGINES)
def test_replays_recordings_and_comparisons_have_the_other_robots(tmp_path: Path, engine: str) -> None:
    path = tmp_path / "a.sim.yml"
    text = written(actor(), "[{travel: {at_least: 0.2 m}}]", engine="auto")
    path.write_text(f"{text}agreement: {{bodies: {{oncoming: {{position: 1 cm}}}}}}\n", encoding="utf-8")
    loaded = load_scenario(path)
    scenario, scene = loaded.scenario.model_copy(update={"backend": engine}), build_scene(loaded)
    recorder = RunRecorder(scenario, filmed=True, recorded=True, compared=True)
    ended = simulate(scenario, scene, lambda _: None, recorder)
    film, motion = recorder.film(), recorder.motion(scene)
    assert film is not None
    assert motion is not None
    moved = motion.bodies["oncoming"]
    assert len(moved) == len(motion.time)
    assert moved[0, 0] - moved[-1, 0] == pytest.approx(ended.travelled, abs=2e-3)
    shown = {body.name: body for body in replay_of(scene, film).scene.bodies}
    assert shown.keys() == {f"oncoming/{link.name}" for link in scene.model.links}
    assert all(body.track is not None and body.shapes for body in shown.values())
    run = RecordedRun.of(scene, film, film, scenario, recorder.twists())
    assert run.bodies["oncoming/base_footprint"][-1, 0] == pytest.approx(moved[-1, 0], abs=0.01)
    frames = Frames.of(run).bodies
    assert frames["oncoming/base_scan"] == "oncoming/base_scan"
    alone = {topic.name for topic in topics(run)}
    told = {topic.name: topic for topic in topics(replace(run, actors=recorder.actors))}
    assert told.keys() - alone == {"/oncoming/joint_states", "/oncoming/odom"}
    joints, odometry = told["/oncoming/joint_states"], told["/oncoming/odom"]
    last = recorder.actors["oncoming"].base_position_xyz[-1, 0]
    assert last == pytest.approx(moved[-1, 0], abs=0.01)
    assert len(joints.messages) == len(odometry.messages) == round(30 * ended.sim_time) + 1
