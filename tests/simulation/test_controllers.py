"""Several sources at once: whose tick it is, and whose joints are whose."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.commands import ClosedLoop
from sim_action.commands.script import ScriptCommands
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Twist
from sim_action.core.permissions import Permissions
from sim_action.drives import recognise
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.controllers import Controls
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.command import NO_PUSH, Command, JointTargets, LinkWrench
from sim_action.state.observation import Observation
from tests.commands.test_pose import mobile
from tests.scenarios import LEAST, load, told
from tests.simulated import simulated
from tests.traces import START

COMMANDS = "commands:\n  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n"
SCRIPT = """\
from sim_action import JointTargets, LinkWrench, Twist

def left(observation):
    return JointTargets(velocity={"wheel_left_joint": 1.0})

def right(observation):
    return JointTargets(velocity={"wheel_right_joint": 2.0})

def both_ways(observation):
    return Twist.planar(1.0) if observation.time < 0.1 else JointTargets(velocity={"wheel_left_joint": 3.0})

def twist_and_left(observation):
    return Twist.planar(1.0), JointTargets(velocity={"wheel_left_joint": 1.0})

def twist_and_nothing(observation):
    return [Twist.planar(1.0), JointTargets()]

def nothing(observation):
    return JointTargets()

def thrust(observation):
    up = LinkWrench("base_footprint", (0.0, 0.0, 1.0))
    begun = up, up, LinkWrench("base_scan", (0.0, 0.0, 5.0))
    return begun if observation.time < 0.1 else LinkWrench("base_footprint")

def gust(observation):
    return Twist.planar(0.1), LinkWrench("base_footprint", (2.0, 0.0, 0.0))

THE_SAME = Twist([0.05, 0.0, 0.0], [0.0, 0.0, 0.0])

def changed_in_place(observation):
    THE_SAME.linear_xyz[0] = 0.05 if observation.time < 0.3 else 0.1
    return THE_SAME

SPEEDS = {"wheel_left_joint": 0.0}

def reused(observation):
    SPEEDS["wheel_left_joint"] += 1.0
    return JointTargets(velocity=SPEEDS)

def by_hand_in_between(observation):
    by_hand = 0.25 < observation.time < 0.35
    return JointTargets(velocity={"wheel_left_joint": 3.0}) if by_hand else Twist.planar(0.05)
"""


def scenario_of(*sources: str) -> str:
    return LEAST.replace(COMMANDS, "".join(["commands:\n", *(f"  - {source}\n" for source in sources)]))


def script(function: str) -> str:
    return f"{{script: ctl.py, function: {function}, rate: 10}}"


def controls(folder: Path, *sources: str, heard: list[tuple[float, Command]] | None = None) -> Controls:
    (folder / "ctl.py").write_text(SCRIPT)
    loaded = load(folder, scenario_of(*sources))
    scene = build_scene(loaded)
    drive, noted = recognise(scene.model), [] if heard is None else heard
    assert drive is not None
    motion = drive.open(scene.model, 240.0)
    return Controls(loaded.scenario, scene, motion, lambda time, twist: noted.append((time, twist)))


def test_every_twist_is_told_when_it_is_given(tmp_path: Path) -> None:
    heard = list[tuple[float, Command]]()
    applied(controls(tmp_path, "{twist: [{linear: 1, for: 0.1}, {angular: 2}], rate: 20}", heard=heard), 48)
    turning = Twist.planar(angular=2.0)
    assert heard == [
        (0.0, Twist.planar(1.0)),
        (0.05, Twist.planar(1.0)),
        (0.1, turning),
        (pytest.approx(0.15), turning),
    ]


def look(step: int) -> Observation:
    return START


def first(found: Controls) -> JointTargets:
    (target, *_) = found.plan(0, 240, look)
    assert target is not None
    return target


def test_the_next_tick_of_any_source_ends_a_plan(tmp_path: Path) -> None:
    found = controls(tmp_path, "{twist: [{linear: 1}], rate: 20}", "{script: ctl.py, function: nothing, rate: 48}")
    ends, step = [], 0
    while step < 24:
        step += len(found.plan(step, 24, look))
        ends.append(step)
    assert ends == [5, 10, 12, 15, 20, 24]


def test_scripts_alone_look_at_sensors(tmp_path: Path) -> None:
    assert controls(tmp_path, "{twist: [{linear: 1}]}", script("nothing")).are_watching
    assert not controls(tmp_path, "{twist: [{linear: 1}]}").are_watching
    assert not controls(tmp_path, "{waypoints: [{x: 1, y: 0}]}").are_watching


def test_sources_of_one_tick_look_once_and_at_the_next_tick_again(tmp_path: Path) -> None:
    looked = list[int]()

    def counted(step: int) -> Observation:
        looked.append(step)
        return START

    found = controls(tmp_path, script("left"), script("right"), script("nothing"))
    targets = [found.plan(step, 240, counted)[0] for step in (0, 24, 48)]
    assert looked == [0, 24, 48]
    # Those that move different joints act at the same time.
    assert targets[0] is not None
    assert targets[0].velocity == {"wheel_left_joint": 1.0, "wheel_right_joint": 2.0}


@pytest.mark.parametrize(
    ("sources", "joint"),
    [
        ((script("left"), script("left")), "wheel_left_joint"),
        (("{twist: [{linear: 1}]}", script("right")), "wheel_right_joint"),
        ((script("left"), "{twist: [{linear: 1}]}"), "wheel_left_joint"),
    ],
)
def test_two_sources_for_one_joint_are_an_error(sources: tuple[str, ...], joint: str, tmp_path: Path) -> None:
    found = controls(tmp_path, *sources)
    with pytest.raises(ScriptError) as raised:
        found.plan(24, 48, look)
    assert raised.value.source == 1
    assert str(raised.value) == (
        f"at 0.1 s of sim time, commands.0 and commands.1 both move joint '{joint}'; "
        "command sources must move different joints"
    )


def test_sources_that_drive_the_same_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match="target for joint 'wheel_left_joint', which the drive moves"):
        first(controls(tmp_path, script("twist_and_left")))
    with pytest.raises(ScriptError, match=r"commands\.0 and commands\.1 both drive the base"):
        first(controls(tmp_path, script("both_ways"), script("twist_and_nothing")))


def test_each_command_of_an_answer_makes_its_joints_the_source_s_own(tmp_path: Path) -> None:
    alone = first(controls(tmp_path, script("twist_and_nothing")))
    assert alone == first(controls(tmp_path, "{twist: [{linear: 1}]}"))
    with pytest.raises(ScriptError, match="both move joint 'wheel_left_joint'"):
        first(controls(tmp_path, script("twist_and_nothing"), script("left")))


def test_one_source_may_take_the_wheels_over_from_the_drive(tmp_path: Path) -> None:
    found = controls(tmp_path, script("both_ways"))
    assert set(first(found).velocity) == {"wheel_left_joint", "wheel_right_joint"}
    (target, *others) = found.plan(24, 48, lambda _: Observation(0.1, START.pose, START.twist, START.joints))
    assert target == JointTargets(velocity={"wheel_left_joint": 3.0})
    assert others == [None] * 23


@pytest.mark.parametrize("function", ["changed_in_place", "by_hand_in_between"])
def test_wheels_are_told_of_a_twist_until_they_turn_as_it_says(tmp_path: Path, function: str) -> None:
    found = controls(tmp_path, script(function))
    ticks = [
        found.plan(step, step + 24, lambda now: Observation(now / 240, START.pose, START.twist, START.joints))
        for step in range(0, 144, 24)
    ]
    assert [any(tick) for tick in ticks] == [True, False, False, True, function == "by_hand_in_between", False]


ROVER = Path(__file__).parents[2] / "examples/drives/rover.urdf"
MECANUM = """\
robot:
  model: rover.urdf
  drive: {mecanum: {left: [front_left_wheel_joint, rear_left_wheel_joint],
                    right: [front_right_wheel_joint, rear_right_wheel_joint]}}
"""
TAKES_OVER = """\
from sim_action import JointTargets, Twist

def control(observation):
    return Twist.planar(1.0) if observation.time < 0.1 else JointTargets(velocity={"rear_left_wheel_joint": 3.0})
"""


def test_a_drive_whose_wheels_are_taken_over_lets_the_base_go(tmp_path: Path) -> None:
    (tmp_path / "rover.urdf").write_bytes(ROVER.read_bytes())
    (tmp_path / "ctl.py").write_text(TAKES_OVER)
    text = scenario_of("{script: ctl.py}").replace("robot:\n  model: turtlebot3_burger\n", MECANUM)
    loaded = load(tmp_path, text)
    scene, drive = build_scene(loaded), loaded.scenario.robot.drive
    assert drive is not None
    found = Controls(loaded.scenario, scene, drive.open(scene.model, 240.0))
    pushed = first(found).base
    assert pushed is not None
    assert pushed.max_force > 0
    (target, *others) = found.plan(24, 48, lambda _: Observation(0.1, START.pose, START.twist, START.joints))
    assert target == JointTargets(velocity={"rear_left_wheel_joint": 3.0}, base=NO_PUSH)
    assert others == [None] * 23


def test_sources_that_move_the_same_are_told_on_their_line(tmp_path: Path) -> None:
    (problem,) = told(tmp_path, scenario_of("{twist: [{linear: 1}]}", "{twist: [{linear: 2}]}"))
    assert problem == ("6:5: commands.1: commands.0 drives the base already; one source at a time does")
    joint = "joints: [{at: 0, position: {wheel_left_joint: 1}}]"
    (problem,) = told(tmp_path, scenario_of("{twist: [{linear: 1}]}", f"{{{joint}}}"))
    assert problem == (
        "6:5: commands.1: joint 'wheel_left_joint' is moved by commands.0 already; "
        "command sources must move different joints"
    )


def test_a_twist_takes_wheels_that_are_known(tmp_path: Path) -> None:
    (tmp_path / "ctl.py").write_text(SCRIPT)
    loaded = load(tmp_path, scenario_of(script("both_ways")))
    with pytest.raises(ScriptError, match=r"the wheels of the robot are unknown; name them in robot\.drive"):
        Controls(loaded.scenario, build_scene(loaded), None).plan(0, 240, look)


@pytest.mark.parametrize(
    ("sources", "velocity", "position"),
    [
        (["twist: [{linear: 1.0}]"], {"wheel_left_joint": 0.0, "wheel_right_joint": 0.0}, {}),
        (["joints: [{at: 0, position: {wheel_left_joint: 1}}]"], {"wheel_right_joint": 0.0}, {"wheel_left_joint": 0.0}),
    ],
)
def test_before_t_0_wheels_are_braked_unless_a_source_holds_them(
    sources: list[str], velocity: dict[str, float], position: dict[str, float], tmp_path: Path
) -> None:
    held = controls(tmp_path, *sources).at_rest
    assert (held.velocity, held.position) == (velocity, position)


def test_wrenches_of_sources_add_up_and_each_source_replaces_its_own_by_link(tmp_path: Path) -> None:
    found = controls(tmp_path, script("thrust"), script("gust"))
    up, ahead = LinkWrench("base_footprint", (0.0, 0.0, 1.0)), LinkWrench("base_footprint", (2.0, 0.0, 0.0))
    scan = LinkWrench("base_scan", (0.0, 0.0, 5.0))
    assert first(found).wrenches == (up, up, scan, ahead)
    assert found.log.wrench == 5.0
    # The wrench of zeros ends those of its own source on this link only.
    (later, *_) = found.plan(24, 240, lambda _step: replace(START, time=0.1))
    assert later is not None
    assert later.wrenches == (LinkWrench("base_footprint"), scan, ahead)


# What each of them draws moves a wheel, so that it can be seen: when it is loaded, and by its own generator.
DRAWS = """\
import random
from sim_action import JointTargets

LOADED = random.random()

class Controller:
    def reset(self, robot):
        self.drawn = float(robot.random.random())

    def step(self, observation):
        return JointTargets(velocity={"wheel_left_joint": self.drawn, "wheel_right_joint": LOADED})
"""


def drawn(folder: Path, *sources: str) -> list[float]:
    """What sources of the same file draw, each asked alone."""
    (folder / "draws.py").write_text(DRAWS)
    loaded = load(folder, scenario_of(*sources))
    numbers = list[float]()
    for source in Controls(loaded.scenario, build_scene(loaded), None)._sources:
        if isinstance(source.controller, ClosedLoop):
            targets = source.controller.command(START)
            assert isinstance(targets, JointTargets)
            numbers += targets.velocity.values()
    return numbers


def test_sources_of_the_same_script_draw_numbers_of_their_own(tmp_path: Path) -> None:
    alone = drawn(tmp_path, "{script: draws.py}")
    three = drawn(tmp_path, "{script: draws.py}", "{script: draws.py}", "{script: draws.py, class: Controller}")
    assert len(set(three)) == 6
    assert three[:2] == alone
    assert drawn(tmp_path, "{twist: [{linear: 1}]}", "{script: draws.py}")[-2:] == alone


def applied(found: Controls, steps: int) -> dict[int, JointTargets]:
    """Return the targets of a run by the step at which they take effect."""
    given, step = dict[int, JointTargets](), 0
    while step < steps:
        planned = found.plan(step, steps, look)
        given |= {step + index: target for index, target in enumerate(planned) if target is not None}
        step += len(planned)
    return given


def test_late_commands_take_effect_between_ticks(tmp_path: Path) -> None:
    late = "{script: ctl.py, function: left, rate: 10, latency: 0.03}"  # 7.2 steps
    found = controls(tmp_path, late, script("right"))
    assert {step: set(target.velocity) for step, target in applied(found, 48).items()} == {
        0: {"wheel_right_joint"},
        8: {"wheel_left_joint"},
        24: {"wheel_right_joint"},
        32: {"wheel_left_joint"},
    }
    found = controls(tmp_path, "{script: ctl.py, function: left, rate: 10, latency: 0.25}")
    assert list(applied(found, 120)) == [60, 84, 108]
    assert list(applied(controls(tmp_path, script("left")), 48)) == [0, 24]  # by default there is none
    found = controls(tmp_path, "{script: ctl.py, function: gust, rate: 10, latency: 0.1}")
    given = {step: target.wrenches for step, target in applied(found, 60).items() if target.wrenches}
    wrench = LinkWrench("base_footprint", (2.0, 0.0, 0.0))
    assert given == {24: (wrench,), 48: (wrench,)}


def test_a_late_command_is_the_one_that_was_sent(tmp_path: Path) -> None:
    found = controls(tmp_path, "{script: ctl.py, function: reused, rate: 10, latency: 0.15}")
    speeds = {step: target.velocity["wheel_left_joint"] for step, target in applied(found, 96).items()}
    assert speeds == {36: 1.0, 60: 2.0, 84: 3.0}


def test_equal_answers_of_a_repeating_source_are_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = Twist.planar(0.05), Twist.planar(0.1)
    answers = iter([None, first, first, first, second, second])
    repeating = ClosedLoop(lambda _: next(answers), repeats=True)
    monkeypatch.setattr(ScriptCommands, "open", lambda *_: repeating)
    heard = list[tuple[float, Command]]()
    applied(controls(tmp_path, "{script: ctl.py, function: nothing, rate: 10, latency: 0.1}", heard=heard), 144)
    assert heard == [(0.2, first), (0.5, second)]


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("latency: 30 s", "latency: 30 s is not shorter than time_limit (30 s), so no command would take effect; low"),
        ("latency: 20, jitter: 10", "jitter: the delay can be 30 s, which is not shorter than time_limit (30 s); low"),
        ("latency: -1 ms", "latency: must be at least 0"),
        ("jitter: -1", "jitter: must be at least 0"),
        ("dropouts: 100 %", "dropouts: must be less than 1"),
        ("dropouts: -0.1", "dropouts: must be at least 0"),
        ("latency: 10 Hz", "latency: 'Hz' is not a unit of time; use one of: "),
        ("latencey: 1", "latencey: unknown key; did you mean 'latency'?"),
    ],
)
def test_delays_that_cannot_be_are_told_on_their_line(keys: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, scenario_of(f"{{twist: [{{linear: 1}}], {keys}}}"))
    assert found.startswith("5:"), found
    assert f": commands.0.{problem}" in found


BURGER = {"model": "turtlebot3_burger"}
DRIVES = {"twist": [{"linear": 0.2, "for": "0.4 s"}, {"angular": 0.5}], "name": "drive"}


def at(seconds: float, name: str, **action: str) -> dict[str, Any]:
    return {"name": name, "when": {"at": seconds}, "do": [action]}


@pytest.mark.parametrize(
    ("keys", "marks"),
    [
        (
            {"commands": {"waypoints": [{"x": 0.05 * n, "y": 0} for n in range(1, 15)], "tolerance": "1 cm"}},
            [*(f"passed waypoint {n} of 14" for n in range(3, 14)), "ended a path of 14 waypoints"],
        ),
        (
            {
                "commands": {"waypoints": [{"x": 0.05 * n, "y": 0} for n in (1, 2)], "max_turn_rate": 2.5},
                "events": [at(seconds, f"at {seconds}", start="waypoints") for seconds in (0.2, 1.5)],
            },
            2 * ["event", "passed waypoint 1 of 2", "ended a path of 2 waypoints"],
        ),
        (
            {"commands": {"replay": "log.csv", "offset": "0.5 s"}},
            ["replay of log.csv began at 0.50 s", "replay of log.csv ended at 1.50 s"],
        ),
        (
            {"commands": {**DRIVES, "latency": "50 ms"}, "events": [at(0.3, "halt", stop="drive")]},
            [
                "messages of commands[0] arrived 0.05 s late at 0.00 s for 0.3 s",
                "event 'halt' happened: stop 'drive' at 0.30 s",
            ],
        ),
        (
            {"commands": DRIVES, "events": [at(1.0, "go", start="drive"), at(1.2, "halt", stop="drive")]},
            [
                "event 'go' happened: start 'drive' at 1.00 s",
                "commanded 0.2 m/s at 1.00 s",
                "event 'halt' happened: stop 'drive' at 1.20 s",
            ],
        ),
        (
            {"world": {"actors": [{"name": "cart", **BURGER, "pose": {"x": 2}, "commands": DRIVES}]}},
            ["'cart': commanded 28.65 deg/s at 0.40 s"],
        ),
    ],
)
def test_the_timeline_has_the_commands_that_were_given(keys: dict[str, Any], marks: list[str], tmp_path: Path) -> None:
    """Of many commands of a source, the last ones: the plot has room for twelve."""
    (tmp_path / "log.csv").write_text("time,linear\n0,0.1\n1,0\n")
    scenario = {"name": "runs", "robot": BURGER, **keys, "expect": ["upright"], "allow": ["never-moved"]}
    (tmp_path / "s.sim.yml").write_text(json.dumps({**scenario, "duration": 6, "time_limit": 6}))
    loaded = load_scenario(tmp_path / "s.sim.yml", Permissions(outside=True))
    footage = RunRecorder(loaded.scenario)
    simulate(loaded.scenario, build_scene(loaded), lambda _: None, footage)
    titles = [mark.title for mark in footage.marks]
    assert len(titles) == len(marks)
    assert all(map(str.startswith, titles, marks)), titles


POSE = {"link": "tip", "orientation": "free", "waypoints": [{"x": 0.5, "y": 0.4, "at": "1 s"}]}
MOTION = """\
from sim_action import JointMotion

MOTIONS = []


def control(seen):
    if not MOTIONS:
        MOTIONS.append(JointMotion.through(["elbow"], [seen.time, seen.time + 1], [[0.5], [1.3]]))
    return MOTIONS[0]
"""


@pytest.mark.parametrize(
    ("source", "is_again"),
    [({"pose": {**POSE, "frame": "base"}}, True), ({"pose": POSE}, True), ({"script": "motion.py"}, False)],
    ids=["open loop", "closed loop", "script"],
)
def test_motions_that_an_event_starts_have_their_times(source: dict[str, Any], is_again: bool, tmp_path: Path) -> None:
    """A path of 1 s counts from its start; a script knows the sim time, and goes on when it is started again."""
    mobile(tmp_path)
    (tmp_path / "motion.py").write_text(MOTION)
    scenario = {
        "name": "moves",
        "robot": {"model": "mobile.urdf", "base": "fixed", "joints": {"elbow": 0.5}},
        "commands": [{**source, "name": "arm"}],
        "events": [at(0.5, "go", start="arm"), at(1.0, "again", start="arm")],
        "expect": [{"joint_within": {"position": {"elbow": [0, 3]}}}],
        "duration": 2.5,
        "time_limit": 2.5,
    }
    trace = simulated(tmp_path, scenario, outside=True).trace
    elbow = np.interp([0.5, 1.6, 2.1, 2.5], trace.time, trace.joint_position[:, 1])
    assert elbow[[0, 2, 3]] == pytest.approx([0.5, 1.3, 1.3], abs=0.04)
    assert (elbow[1] < 1.2) == is_again
