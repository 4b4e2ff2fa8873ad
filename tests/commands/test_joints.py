"""Joint targets over time: what each tick gives, by hand, and what is told before anything runs."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.commands import OpenLoop
from sim_action.commands.joints import BLENDS, Interpolation, JointCommands, JointPath
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import JointTargets
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.scenarios import load, told

STEP: Final = 1e-5
rising = st.lists(st.floats(0, 100), min_size=2, max_size=6, unique_by=lambda time: round(time, 1)).map(sorted)
numbers = st.floats(-100, 100)


@st.composite
def paths(draw: st.DrawFn, *kinds: Interpolation) -> JointPath:
    times = draw(rising)
    assume(all(later - earlier > 0.05 for earlier, later in pairwise(times)))
    values = tuple(draw(numbers) for _ in times)
    return JointPath(tuple(times), values, BLENDS[draw(st.sampled_from(kinds))])


def speed(path: JointPath, time: float) -> float:
    return (path.value(time + STEP) - path.value(time - STEP)) / (2 * STEP)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("linear", (1.0, 1.0, 1.5, 2.0, 3.0, 2.0, 1.0, 1.0)),
        # 10 / 4^3 - 15 / 4^4 + 6 / 4^5 = 106 / 1024.
        ("minimum_jerk", (1.0, 1.0, 1 + 2 * 106 / 1024, 2.0, 3.0, 2.0, 1.0, 1.0)),
        ("hold", (1.0, 1.0, 1.0, 1.0, 3.0, 3.0, 1.0, 1.0)),
    ],
)
def test_a_way_from_1_to_3_and_back(kind: Interpolation, values: tuple[float, ...]) -> None:
    path = JointPath((1.0, 3.0, 7.0), (1.0, 3.0, 1.0), BLENDS[kind])
    assert [path.value(time) for time in (0.0, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 9.0)] == pytest.approx(values)


def test_one_knot_is_a_constant() -> None:
    path = JointPath((1.0,), (2.5,), BLENDS["linear"])
    assert [path.value(time) for time in (0.0, 1.0, 2.0)] == [2.5, 2.5, 2.5]


@given(paths("linear", "minimum_jerk", "hold"))
def test_a_path_goes_through_its_knots(path: JointPath) -> None:
    assert [path.value(time) for time in path.times] == list(path.values)


@given(paths("linear", "minimum_jerk", "hold"), st.floats(-10, 110))
def test_a_path_stays_between_its_knots(path: JointPath, time: float) -> None:
    assert min(path.values) - 1e-9 <= path.value(time) <= max(path.values) + 1e-9


@given(paths("linear", "minimum_jerk"), st.floats(0, 100))
def test_a_path_has_no_gaps_and_is_no_faster_than_it_says(path: JointPath, time: float) -> None:
    assert path.blend.peak is not None
    fastest = max(
        abs(there - here) / (later - earlier)
        for (earlier, later), (here, there) in zip(pairwise(path.times), pairwise(path.values), strict=True)
    )
    assert abs(speed(path, time)) <= path.blend.peak * fastest * (1 + 1e-6) + 1e-6


@given(paths("minimum_jerk"))
def test_minimum_jerk_rests_in_every_knot(path: JointPath) -> None:
    """The speed near a knot goes with the square of the time, so that neither it nor the acceleration jumps."""
    for time in path.times:
        assert speed(path, time) == pytest.approx(0.0, abs=30 * 200 * STEP**2 / 0.05**3 + 1e-8)


@given(paths("minimum_jerk"))
def test_minimum_jerk_is_fastest_half_way(path: JointPath) -> None:
    for (earlier, later), (here, there) in zip(pairwise(path.times), pairwise(path.values), strict=True):
        mean = (there - here) / (later - earlier)
        assert speed(path, (earlier + later) / 2) == pytest.approx(1.875 * mean, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
def test_minimum_jerk_is_the_same_backwards(share: float) -> None:
    blend = BLENDS["minimum_jerk"].share
    assert blend(share) + blend(1 - share) == pytest.approx(1.0)


def test_minimum_jerk_has_the_least_squared_jerk() -> None:
    """Of all ways from rest to rest in unit time it has 720 (Flash and Hogan 1985); a quintic with more has more."""
    count = 4000
    blend = BLENDS["minimum_jerk"].share
    cells = [index / count for index in range(count + 1)]
    jerks = [(blend(d) - 3 * blend(c) + 3 * blend(b) - blend(a)) * count**3 for a, b, c, d in quadruples(cells)]
    assert math.fsum(jerk**2 for jerk in jerks) / count == pytest.approx(720.0, rel=0.01)


def quadruples(cells: list[float]) -> list[tuple[float, float, float, float]]:
    return list(zip(cells, cells[1:], cells[2:], cells[3:], strict=False))


EXAMPLES = Path(__file__).parents[2] / "examples/commands"
HERE = Workspace(EXAMPLES, EXAMPLES)


def scene(**joints: float) -> Scene:
    robot = Robot(model="arm.urdf", base="fixed", joints={**joints})
    return Scene(robot, load_model(robot, HERE), World(), Physics(), HERE)


def spec(*points: dict[str, Any], **others: Any) -> JointCommands:
    return JointCommands.model_validate({"joints": points, **others})


def told_at(commands: JointCommands, times: Iterable[float], where: Scene) -> list[JointTargets | None]:
    controller = commands.open(where)
    assert isinstance(controller, OpenLoop)
    found = [controller.command(time) for time in times]
    return [command for command in found if command is None or isinstance(command, JointTargets)]


def at(commands: JointCommands, time: float, where: Scene | None = None) -> JointTargets | None:
    """Return the targets at a tick, with the positions of their motions at its time."""
    (found,) = told_at(commands, [time], where or scene())
    return None if found is None else moved(found, time)


def moved(targets: JointTargets, time: float) -> JointTargets:
    states = {
        name: curve.at(time)
        for motion in targets.motions
        for name, curve in zip(motion.names, motion.curves, strict=True)
    }
    return JointTargets(
        position={name: position for name, (position, *_) in states.items()},
        velocity={**{name: speed for name, (_, speed, _) in states.items()}, **targets.velocity},
        effort=targets.effort,
    )


def near(**values: float) -> Any:
    return pytest.approx(values, abs=1e-7)


def test_a_straight_motion_passes_its_points_and_ramps_its_speed() -> None:
    commands = spec({"at": 1, "position": {"elbow": 0.4}}, {"at": 2, "position": {"elbow": 1.0}})
    assert at(commands, 0.0) == JointTargets(position=near(elbow=0.0), velocity=near(elbow=0.0))
    assert at(commands, 1.0) == JointTargets(position=near(elbow=0.4), velocity=near(elbow=0.4))
    assert at(commands, 2.0) == JointTargets(position=near(elbow=1.0), velocity=near(elbow=0.0))
    half_way = at(commands, 0.5)
    assert half_way is not None
    # The ramp from rest takes 20 ms, and costs 10 ms; the other one is to the speed at the point.
    assert half_way.velocity == near(elbow=(0.4 - 0.4 * 0.01) / 0.98)


@pytest.mark.parametrize("rate", [10, 40, 240])
def test_a_motion_is_the_same_at_every_rate_and_answered_as_a_whole(rate: float) -> None:
    commands = spec({"at": 1, "position": {"elbow": 1.0}}, rate=rate)
    first, later = told_at(commands, [0.0, 0.5], scene())
    assert first is not None
    assert later is not None
    assert first.motions[0] is later.motions[0]
    assert moved(first, 0.3) == moved(spec({"at": 1, "position": {"elbow": 1.0}}).open(scene()).command(0.0), 0.3)  # type: ignore[arg-type]


def test_minimum_jerk_is_half_way_at_half_time_with_1875_of_the_mean_speed() -> None:
    commands = spec({"at": 2, "position": {"elbow": 1.0}}, interpolation="minimum_jerk", rate=240)
    found = at(commands, 1.0)
    assert found is not None
    assert found.position == near(elbow=0.5)
    assert found.velocity["elbow"] == pytest.approx(1.875 / 2)


def test_a_position_begins_where_the_joint_does_and_others_at_0() -> None:
    point = {"at": 2, "position": {"elbow": 1}, "velocity": {"turntable": 2}, "effort": {"shoulder": 4}}
    found = at(spec(point, rate=240), 1.0, scene(elbow=-1.0))
    middle = 1 + 1 / 480
    assert found == JointTargets(
        position=near(elbow=0.0), velocity=near(elbow=1 / 0.99, turntable=middle), effort=near(shoulder=2 * middle)
    )
    commands = spec({"at": 0, "position": {"elbow": 0.5}}, {"at": 1, "position": {"elbow": 1.5}}, rate=240)
    assert at(commands, 0.0, scene(elbow=-1.0)) == JointTargets(position=near(elbow=0.5), velocity=near(elbow=0.0))
    # A point does not concern joints that it does not name.
    both = spec(
        {"at": 1, "position": {"shoulder": 0.5}}, {"at": 2, "position": {"elbow": 1, "shoulder": 1.5}}, rate=240
    )
    elbow = 1 / 1.98
    assert at(both, 1.0) == JointTargets(
        position=near(elbow=0.5, shoulder=0.5), velocity=near(elbow=elbow, shoulder=0.5)
    )


@pytest.mark.parametrize(("time", "elbow"), [(0.0, 0.1), (0.975, 0.1), (1.0, 0.5), (1.1, 0.5), (2.0, 0.2)])
def test_hold_steps_at_the_tick_that_falls_on_a_point(time: float, elbow: float) -> None:
    commands = spec({"at": 1, "position": {"elbow": 0.5}}, {"at": 2, "position": {"elbow": 0.2}}, interpolation="hold")
    assert at(commands, time, scene(elbow=0.1)) == JointTargets(position={"elbow": elbow}, velocity={"elbow": 0.0})


def test_hold_steps_whatever_the_rounding_of_a_tick() -> None:
    points = [{"at": n / 10, "effort": {"elbow": float(n)}} for n in range(30)]
    commands = spec(*points, interpolation="hold", rate=10)
    assert [at(commands, n / 10) for n in range(30)] == [JointTargets(effort={"elbow": float(n)}) for n in range(30)]


@pytest.mark.parametrize("interpolation", ["linear", "minimum_jerk", "hold"])
@given(end=st.floats(0.01, 5), rate=st.sampled_from([10.0, 40.0, 240.0]))
def test_it_ends_at_rest_at_the_last_point_and_says_no_more(interpolation: str, end: float, rate: float) -> None:
    point = {"at": end, "position": {"elbow": 1.0}, "effort": {"shoulder": 2.0}}
    ticks = told_at(
        spec(point, interpolation=interpolation, rate=rate), [tick / rate for tick in range(int(end * rate) + 5)], ARM
    )
    said = [found for found in ticks if found is not None]
    assert said == ticks[: len(said)]
    assert len(said) < len(ticks)
    last = moved(said[-1], end)
    assert (last.position, last.effort) == (near(elbow=1.0), near(shoulder=2.0))
    assert last.velocity == near(elbow=0.0)


ARM = scene()


def test_units_joints_and_rest() -> None:
    point = {"at": 0, "position": {"elbow": "90 deg"}, "effort": {"left_finger_joint": "500 mN"}}
    found = at(spec(point, {"at": 1, "velocity": {"turntable": "60 rpm"}}, rate=240), 1.0)
    assert found is not None
    assert (found.position, found.effort) == (near(elbow=1.5707963267948966), near(left_finger_joint=0.5))
    assert found.velocity == near(elbow=0.0, turntable=6.283185307179586)
    # A source knows its joints and needs no drive.
    commands = spec({"at": 1, "position": {"a": 1}, "effort": {"b": 1}}, {"at": 2, "velocity": {"c": 1}})
    assert commands.joints(scene()) == {"a", "b", "c"}
    assert not commands.needs_drive
    assert not commands.runs_user_code
    # Before 0 positions are held and velocities braked.
    point = {"at": 0, "position": {"elbow": 1}, "velocity": {"turntable": 2}, "effort": {"shoulder": 4}}
    controller = spec(point).open(scene(elbow=-1.0))
    assert isinstance(controller, OpenLoop)
    held = controller.holding
    assert held == JointTargets(position={"elbow": -1.0}, velocity={"turntable": 0.0})


def test_a_pattern_means_all_joints_with_a_motor_but_those_that_are_named() -> None:
    commands = spec({"at": 0, "position": {"*": 0.25, "elbow": 1.0}, "velocity": {"turntable": 2.0}})
    found = at(commands, 0.0)
    assert found is not None
    # Fingers slide; one of them mimics the other, and has no motor.
    assert found.position == near(shoulder=0.25, elbow=1.0, left_finger_joint=0.25)
    assert commands.joints(ARM) == {"shoulder", "elbow", "left_finger_joint", "turntable"}


@pytest.mark.parametrize(
    ("point", "problems"),
    [
        ({"*_elbow": 1}, ["no moving joint matches '*_elbow'; did you mean 'elbow'? (allowed: elbow, "]),
        ({"right_*": 0}, ["'right_*' names no joint with a motor of its own: joint 'right_finger_joint' cannot be "]),
        (
            {"s*": 1, "*r": 1.5},
            ["'s*' sets joint 'shoulder' to 1, '*r' to 1.5; name the joint itself, or change a pattern"] * 2,
        ),
        ({"s*": 1, "*r": 1}, []),
        ({"e*": 2.5}, ["joint 'elbow': 143.2 deg is outside the limits of the joint"]),
    ],
)
def test_what_is_wrong_with_a_pattern_is_told_at_its_line(point: dict[str, float], problems: list[str]) -> None:
    found = list(spec({"at": 9, "position": point}).model_problems(ARM))
    assert [path[:3] for path, _ in found] == [("joints", 0, "position")] * len(problems)
    assert len({path for path, _ in found}) == len(problems)
    assert all(message.startswith(problem) for (_, message), problem in zip(found, problems, strict=True))


def test_a_pattern_and_a_name_give_one_joint_one_kind_of_target() -> None:
    commands = spec({"at": 1, "position": {"e*": 1}}, {"at": 2, "velocity": {"elbow": 1}})
    assert not list(commands.problems(HERE))
    ((path, message),) = commands.model_problems(ARM)
    assert path == ("joints", 1, "velocity", "elbow")
    assert message.startswith("joint 'elbow' also has a position target, at 1 s")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"joints": ()}, "at least 1 item"),
        ({"joints": ({"at": 1},)}, "a point must name at least one joint"),
        ({"joints": ({"at": 1, "position": {}},)}, "a point must name at least one joint"),
        ({"joints": ({"position": {"a": 1}},)}, "Field required"),
        ({"joints": ({"at": -1, "position": {"a": 1}},)}, "greater than or equal to 0"),
        ({"joints": ({"at": 1, "position": {"a": "1 rad/s"}},)}, "'rad/s' is not a unit of angle or length"),
        ({"joints": ({"at": 1, "velocity": {"a": "1 rad"}},)}, "'rad' is not a unit of angular speed or speed"),
        ({"joints": ({"at": 1, "effort": {"a": "1 m"}},)}, "'m' is not a unit of torque or force"),
        ({"joints": ({"at": 1, "position": {"a": 1}},), "interpolation": "cubic"}, "Input should be 'linear'"),
        ({"points": ({"at": 1, "position": {"a": 1}},)}, "Field required"),
    ],
)
def test_what_is_no_list_of_points_is_refused(data: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        JointCommands.model_validate(data)


def scenario(folder: Path, points: str, others: str = "", robot: str = "") -> str:
    """One whose points begin on line 4."""
    shutil.copy(EXAMPLES / "arm.urdf", folder)
    return (
        f"name: arm\nrobot: {{model: arm.urdf, base: fixed{robot}}}\ncommands:\n  joints: {points}\n{others}"
        "expect: [settled]\ntime_limit: 9 s\n"
    )


WRONG = {
    "unknown": (
        "[{at: 1, position: {elbwo: 1}}, {at: 2, position: {elbwo: 1}}]",
        "0.position.elbwo: the model has no moving joint 'elbwo'; did you mean 'elbow'? (allowed: elbow, left_finger",
    ),
    "fixed": ("[{at: 1, effort: {wrist: 1}}]", "0.effort.wrist: the model has no moving joint 'wrist'"),
    "follows": (
        "[{at: 1, position: {right_finger_joint: 1 mm}}]",
        "0.position.right_finger_joint: joint 'right_finger_joint' cannot be commanded: it mimics 'left_",
    ),
    "beyond": (
        "[{at: 9, position: {elbow: 2.5}}]",
        "0.position.elbow: 143.2 deg is outside the limits of the joint, -137.5 deg to 137.5 deg",
    ),
    "unit of a joint that slides": (
        "[{at: 1, position: {elbow: 1 cm}}]",
        "0.position.elbow: 'cm' is not a unit of angle; use one of: rad, deg",
    ),
    "unit of a joint that turns": (
        "[{at: 1, effort: {left_finger_joint: 1 N m}}]",
        "0.effort.left_finger_joint: 'N m' is not a unit of force; use one of: N, mN, kN",
    ),
    "fast": (
        "[{at: 1, velocity: {elbow: -4 rad/s}}]",
        "0.velocity.elbow: 229.2 deg/s is more than the joint's velocity limit, 171.9 deg/s",
    ),
    "strong": (
        "[{at: 1, effort: {elbow: 11 N m}}]",
        "0.effort.elbow: 11 N m is more than the joint's effort limit, 10 N m",
    ),
    "short": (
        "[{at: 1, position: {elbow: -1}}, {at: 1.5, position: {elbow: 1}}]",
        "1.position.elbow: the time since 1 s is too short: 229.2 deg/s is more than the joint's velocity limit, 171.",
    ),
    "not in order": (
        "[{at: 1, position: {elbow: 1}}, {at: 1, position: {elbow: -1}}]",
        "1.at: must be later than the point before it, at 1 s",
    ),
    "two kinds": (
        "[{at: 1, position: {elbow: 1}}, {at: 2, velocity: {elbow: 1}}, {at: 3, effort: {elbow: 1}}]",
        "1.velocity.elbow: joint 'elbow' also has a position target, at 1 s; use only one of position, velocity",
    ),
}


@pytest.mark.parametrize(("points", "problem"), WRONG.values(), ids=WRONG)
def test_what_a_joint_cannot_do_is_told_on_its_line(points: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, scenario(tmp_path, points))
    assert found.startswith("4:")
    assert f" commands.joints.{problem}" in found


def test_where_a_joint_begins_counts_and_is_told_once(tmp_path: Path) -> None:
    points = "[{at: 1, position: {elbow: 2}}]"
    assert load(tmp_path, scenario(tmp_path, points))
    (found,) = told(tmp_path, scenario(tmp_path, points, robot=", joints: {elbow: -2}"))
    assert "the time since 0 s is too short" in found
    assert load(tmp_path, scenario(tmp_path, "[{at: 0, position: {elbow: 2}}]"))
    text = scenario(tmp_path, "[{at: 1, position: {elbow: 2}}]", robot=", joints: {elbow: 1 m}")
    (found,) = told(tmp_path, text)
    assert "robot.joints.elbow" in found
    # Of very many unknown joints the first are told.
    names = ", ".join(f"no{number}: 1" for number in range(1000))
    assert len(told(tmp_path, scenario(tmp_path, f"[{{at: 1, position: {{{names}}}}}]"))) == 10


def test_minimum_jerk_needs_more_time_and_a_step_none(tmp_path: Path) -> None:
    points = "[{at: 1, position: {elbow: 2}}]"
    assert load(tmp_path, scenario(tmp_path, points, "  interpolation: linear\n"))
    (found,) = told(tmp_path, scenario(tmp_path, points, "  interpolation: minimum_jerk\n"))
    assert "214.9 deg/s is more than the joint's velocity limit, 171.9 deg/s; allow 1.25 s" in found
    points = "[{at: 0.01, position: {elbow: 2}}]"
    assert load(tmp_path, scenario(tmp_path, points, "  interpolation: hold\n"))
    # The time that is advised is enough.
    for end, problems in ((1.25, 0), (1.24, 1)):
        text = scenario(tmp_path, f"[{{at: {end}, position: {{elbow: 2}}}}]", "  interpolation: minimum_jerk\n")
        assert len(told(tmp_path, text) if problems else []) == problems
        assert problems or load(tmp_path, text)
    text = scenario(tmp_path, "[{at: 1, position: {elbow: 2}}]")
    arm = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(arm.replace('velocity="3"', 'velocity="1e-320"'))
    (found,) = told(tmp_path, text)
    assert found.endswith("; the joint would need days")


def test_two_sources_for_one_joint_are_told(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "arm.urdf", tmp_path)
    (found,) = told(
        tmp_path,
        """\
name: arm
robot: {model: arm.urdf, base: fixed}
commands:
  - joints: [{at: 1, position: {elbow: 1}}]
  - joints: [{at: 1, velocity: {elbow: 1, shoulder: 1}}]
expect: [settled]
time_limit: 9 s
""",
    )
    assert found.startswith("5:5: commands.1: joint 'elbow' is moved by commands.0 already")
