"""Mutations at the seams of a run: altered commands, motors that are off, frozen sensors, a heavier robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import pytest

from sim_action.commands import ClosedLoop, OpenLoop
from sim_action.core.geometry import Twist
from sim_action.core.records import replace
from sim_action.drives import recognise
from sim_action.scenario.mutation import UNTOUCHED, Mutation, SensorFault
from sim_action.sensors import Sight
from sim_action.simulation.mutations import MutantSeams, heavier, partners, without_motor
from sim_action.state.command import Answer, JointTargets, LinkWrench
from sim_action.state.readings import ImuReading
from sim_action.world.scene import Fitting
from tests.traces import WHEELS, scene

LEFT, RIGHT = WHEELS


def answered(mutation: Mutation, answer: Answer) -> Answer:
    """The answer of a controller as it reaches the robot."""
    controller = MutantSeams(mutation, scene()).controller(OpenLoop(lambda _: answer))
    return cast(OpenLoop, controller).command(0.0)


def test_without_a_mutation_nothing_is_wrapped() -> None:
    controller, here = OpenLoop(lambda _: None), scene()
    assert UNTOUCHED.controller(controller) is controller
    assert UNTOUCHED.scene(here) is here
    assert not UNTOUCHED.runs_on
    assert MutantSeams(Mutation(), here).runs_on


@pytest.mark.parametrize(
    ("mutation", "sent", "taken"),
    [
        (Mutation(), Twist.planar(1.0, 0.5), Twist.planar(1.0, 0.5)),
        (Mutation(silent=True), Twist.planar(1.0, 0.5), None),
        (Mutation(speed=0.5), Twist.planar(1.0, 0.5), Twist.planar(0.5, 0.25)),
        (Mutation(mirrored=True), Twist((1, 2, 3), (4, 5, 6)), Twist((1, -2, 3), (-4, 5, -6))),
        (Mutation(speed=2.0), (Twist.planar(1.0),), (Twist.planar(2.0),)),
        (Mutation(speed=2.0), None, None),
        (
            Mutation(speed=2.0),
            JointTargets({LEFT: 1.0}, {LEFT: 2.0}, {RIGHT: 3.0}, {LEFT: 4.0}),
            JointTargets({LEFT: 2.0}, {LEFT: 4.0}, {RIGHT: 6.0}, {LEFT: 4.0}),
        ),
        (Mutation(mirrored=True), JointTargets(velocity={LEFT: 1.0}), JointTargets(velocity={RIGHT: 1.0})),
        (
            Mutation(mirrored=True),
            LinkWrench("a", (1, 2, 3), (4, 5, 6), point_xyz=(7, 8, 9)),
            LinkWrench("a", (1, -2, 3), (-4, 5, -6), point_xyz=(7, -8, 9)),
        ),
        (Mutation(speed=0.5), LinkWrench("a", (2, 4, 6)), LinkWrench("a", (1, 2, 3))),
        (Mutation(reversed="linear"), Twist((1, 2, 3), (4, 5, 6)), Twist((-1, -2, -3), (4, 5, 6))),
        (Mutation(reversed="angular"), Twist((1, 2, 3), (4, 5, 6)), Twist((1, 2, 3), (-4, -5, -6))),
        (Mutation(reversed="angular"), LinkWrench("a", (1, 2, 3), (4, 5, 6)), LinkWrench("a", (1, 2, 3), (-4, -5, -6))),
        (Mutation(reversed="linear"), JointTargets(velocity={LEFT: 1.0}), JointTargets(velocity={LEFT: 1.0})),
        (
            Mutation(reversed_joint=LEFT),
            JointTargets({LEFT: 1.0, RIGHT: 1.0}, {LEFT: 2.0}, {LEFT: 3.0}, {LEFT: 4.0}),
            JointTargets({LEFT: -1.0, RIGHT: 1.0}, {LEFT: -2.0}, {LEFT: -3.0}, {LEFT: 4.0}),
        ),
        (
            Mutation(dead_joint=LEFT),
            JointTargets({LEFT: 1.0, RIGHT: 1.0}),
            JointTargets({RIGHT: 1.0}, effort={LEFT: 0}),
        ),
    ],
)
def test_commands_are_altered(mutation: Mutation, sent: Answer, taken: Answer) -> None:
    assert answered(mutation, sent) == taken


def test_the_same_answer_becomes_the_same_altered_one() -> None:
    """A controller with `repeats` sends each answer once: they are told apart as objects."""
    answers = [Twist.planar(1.0)] * 2 + [Twist.planar(1.0)]
    given = iter(answers)
    controller = MutantSeams(Mutation(speed=2.0), scene()).controller(ClosedLoop(lambda _: next(given)))
    first, second, third = (controller.command(cast(Any, None)) for _ in answers)
    assert first is second
    assert first == third
    assert first is not third


def test_a_motor_that_is_off_holds_nothing_while_the_robot_settles() -> None:
    held = JointTargets({LEFT: 0.0, RIGHT: 0.0})
    seams = MutantSeams(Mutation(dead_joint=LEFT), scene())
    assert seams.at_rest(held) == JointTargets({RIGHT: 0.0}, effort={LEFT: 0.0})
    assert MutantSeams(Mutation(), scene()).at_rest(held) is UNTOUCHED.at_rest(held) is held
    targets = JointTargets({LEFT: 0.0}, max_effort={LEFT: 1.0})
    assert without_motor(targets, "other") is targets
    assert without_motor(targets, LEFT) == JointTargets(effort={LEFT: 0.0})


def test_a_wheel_without_motor_gets_no_speed() -> None:
    here = scene()
    drive = recognise(here.model)
    assert drive is not None
    motion = drive.open(here.model, 240.0)
    seams = MutantSeams(Mutation(dead_joint=LEFT), here)
    off = seams.motion(motion)
    assert off is not None
    assert (off.joints, off.released, off.notes) == (motion.joints, motion.released, motion.notes)
    targets = off.targets(Twist.planar(0.2), 1)[0]
    assert (set(targets.velocity), targets.effort) == ({RIGHT}, {LEFT: 0.0})
    assert seams.motion(None) is None
    turn = drive.open(here.model, 240.0).targets(Twist.planar(0.2, 1.0), 1)[0].velocity
    for mutation, wheels in (
        (Mutation(crossed_wheels=True), {LEFT: turn[RIGHT], RIGHT: turn[LEFT]}),
        (Mutation(reversed_joint=LEFT), {LEFT: -turn[LEFT], RIGHT: turn[RIGHT]}),
    ):
        rewired = MutantSeams(mutation, here).motion(drive.open(here.model, 240.0))
        assert rewired is not None
        assert rewired.targets(Twist.planar(0.2, 1.0), 1)[0].velocity == pytest.approx(wheels)
    assert MutantSeams(Mutation(dead_joint="arm"), here).motion(motion) is motion


@pytest.mark.parametrize(
    ("reading", "rates"),
    [
        ("frozen", [1.0, 1.0, 1.0]),
        ("stale", [1.0, 1.0, 1.4]),
        ("biased", [1.2, 1.6, 2.2]),
        ("drifting", [1.04, 1.456, 2.08]),
    ],
)
def test_a_faulty_sensor_has_the_present_time(reading: SensorFault, rates: list[float]) -> None:
    def measure(sight: Sight) -> ImuReading:
        return ImuReading(sight.time, (0, 0, 0, 1), (sight.time, 0, 0), (0, 0, 9.8))

    imu = Fitting("imu", "imu", "base_link", 10.0)
    seams = MutantSeams(Mutation(sensor="imu", reading=reading), replace(scene(), sensors=(imu,)))
    faulty: Any = seams.measure("imu", measure)
    readings = [faulty(Sight(time, cast(Any, None), cast(Any, None))) for time in (1.0, 1.4, 2.0)]
    assert [found.time for found in readings] == [1.0, 1.4, 2.0]
    assert [found.angular_velocity_xyz[0] for found in readings] == pytest.approx(rates)
    assert seams.measure("other", measure) is measure


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["wheel_left", "wheel_right", "caster"], {"wheel_left": "wheel_right", "wheel_right": "wheel_left"}),
        (["LeftHip", "RightHip"], {"LeftHip": "RightHip", "RightHip": "LeftHip"}),
        (["FL_hip", "FR_hip", "RL_hip"], {"FL_hip": "FR_hip", "FR_hip": "FL_hip"}),
        (["arm_l", "arm_r"], {"arm_l": "arm_r", "arm_r": "arm_l"}),
        (["lift", "rift", "roll"], {}),
        (["left"], {}),
    ],
)
def test_partners_are_joints_on_the_other_side(names: list[str], found: Mapping[str, str]) -> None:
    assert partners(names) == found


def test_a_heavier_robot_has_more_mass_and_inertia_in_all_links() -> None:
    model = scene().model
    heavy = heavier(model, 2.0)
    assert heavy.mass == pytest.approx(2 * model.mass)
    assert all(
        heavy.links_by_name[link.name].inertial == link.inertial.scaled(2.0) for link in model.links if link.inertial
    )
    assert MutantSeams(Mutation(mass=2.0), scene()).scene(scene()).model == heavy
    assert heavier(heavy, 0.5).urdf.count("<mass") == model.urdf.count("<mass")
    assert heavier(heavy, 0.5).links == model.links
