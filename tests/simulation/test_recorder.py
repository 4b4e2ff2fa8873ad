"""What is kept of a run while it lasts: the moments of every so many steps, and the very last; all for comparisons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.core import geometry
from sim_action.core.geometry import Twist
from sim_action.robot.model.kinematics import link_poses
from sim_action.scenario.model import Agreement, PoseAgreement, TraceSettings
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.command import Command, JointTargets, LinkWrench
from sim_action.state.observation import JointState
from sim_action.world import Body, Sphere, World
from tests import traces

RATE = 240
STRIDE = 24


@pytest.mark.parametrize("steps", [1, 23, 24, 25, 240, 241])
@pytest.mark.parametrize("cut", [1, 24, 100, 239])
def test_however_a_run_is_cut_all_moments_of_its_rate_are_kept_and_the_last(steps: int, cut: int) -> None:
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())))
    footage.begin(replace(traces.START, joints=dict.fromkeys(traces.WHEELS, JointState(0, 0, 0))))
    for first in range(1, steps + 1, cut):
        last = min(first + cut - 1, steps)
        seen = traces.trace([step / RATE for step in range(first, last + 1)])
        footage.add(seen, judged={}, is_last=last == steps)
    kept = footage.trace()
    assert kept is not None
    assert [round(time * RATE) for time in kept.time] == sorted({*range(0, steps + 1, STRIDE), steps})


BALLS = World(
    objects=(
        Body(name="first", sphere=Sphere(radius=0.1), mass=1.0),
        Body(name="wall", box=(0.1, 2.0, 0.5)),
        Body(name="second", sphere=Sphere(radius=0.1), mass=1.0),
    )
)
NAMED = Agreement(
    links={"wheel_left_link": PoseAgreement(position=0.01)}, bodies={"second": PoseAgreement(position=0.01)}
)


@pytest.mark.parametrize("trace_rate", [1.0, 10.0, 240.0])
@pytest.mark.parametrize("cut", [1, 100, 239])
def test_a_compared_run_keeps_every_step_whatever_the_rate_of_its_trace(cut: int, trace_rate: float) -> None:
    changes = {"agreement": NAMED, "world": BALLS, "trace": TraceSettings(rate=trace_rate)}
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())).model_copy(update=changes), compared=True)
    steps = 241
    time = np.arange(steps + 1) / RATE
    whole = traces.trace(time.tolist(), x=time.tolist(), yaw=(2 * time).tolist(), position=(3 * time).tolist())
    balls = np.zeros((steps + 1, 2, 7))
    balls[:, :, 6], balls[:, 1, 0] = 1.0, 4 * time
    joints = dict.fromkeys(traces.WHEELS, JointState(0, 0, 0))
    footage.begin(replace(traces.START, joints=joints), balls[0])
    for first in range(1, steps + 1, cut):
        last = min(first + cut, steps + 1)
        # Bodies may have more rows than the robot, if the run ended inside the period.
        footage.add(whole.rows(slice(first, last)), judged={}, is_last=last > steps, bodies=balls[first : last + 3])
    motion = footage.motion(traces.scene())
    assert motion is not None
    np.testing.assert_array_equal(motion.time, time)
    np.testing.assert_array_equal(motion.base, whole.state[:, 1:8])
    np.testing.assert_array_equal(motion.joints[traces.WHEELS[0]], 3 * time)
    assert motion.units == dict.fromkeys(traces.WHEELS, "rad")
    assert list(motion.bodies) == ["second"]
    np.testing.assert_array_equal(motion.bodies["second"], balls[:, 1])
    (seen,) = motion.links.values()
    for row in (0, 100, 241):
        base = geometry.Pose(tuple(motion.base[row, :3].tolist()), tuple(motion.base[row, 3:].tolist()))
        wheels = {name: float(column[row]) for name, column in motion.joints.items()}
        wheel = geometry.compose(base, link_poses(traces.burger(), wheels)["wheel_left_link"])
        np.testing.assert_allclose(seen[row], [*wheel.position_xyz, *wheel.orientation_xyzw], atol=1e-12)


def test_nothing_is_kept_that_nobody_asked_for() -> None:
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())))
    footage.begin(replace(traces.START, joints=dict.fromkeys(traces.WHEELS, JointState(0, 0, 0))))
    assert footage.motion(traces.scene()) is None
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())))
    footage.command(0.0, JointTargets(position={"arm": 1.0}))
    footage.command(0.0, Twist.planar(1.0))
    assert not footage.commanded()


def test_the_film_has_the_commands_of_its_moments() -> None:
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())), filmed=True)
    commands: list[tuple[float, Command]] = [
        (0.0, JointTargets(position={"arm": 1.0})),
        (1 / RATE, JointTargets(position={"arm": 2.0})),
        (8 / RATE, Twist.planar(1.0)),
        (8 / RATE, JointTargets(position={"arm": 3.0})),
        (9 / RATE, JointTargets(velocity={"arm": 3.0})),
    ]
    for time, command in commands:
        footage.command(time, command)
    found = footage.commanded()["position"].at("arm", np.array([0, 8, 16]) / RATE)
    np.testing.assert_array_equal(found, [1.0, 3.0, np.nan])
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())), filmed=True)
    pushes = (LinkWrench("arm", force_xyz=(0.0, 0.0, 2.0)), LinkWrench("arm", force_xyz=(0.0, 0.0, 3.0)))
    footage.command(0.0, Twist.planar(1.0, 0.5))
    footage.command(0.0, JointTargets(velocity={"arm": 2.0}, wrenches=pushes))
    footage.command(8 / RATE, JointTargets(effort={"arm": 4.0}))
    commanded, times = footage.commanded(), np.array([0, 8]) / RATE
    assert commanded["base"].at("linear x", times).tolist() == [1.0, 1.0]
    assert commanded["base"].at("angular z", times).tolist() == [0.5, 0.5]
    assert commanded["wrench"].at("force on arm z", times).tolist() == [5.0, 5.0]
    np.testing.assert_array_equal(commanded["velocity"].at("arm", times), [2.0, np.nan])
    np.testing.assert_array_equal(commanded["effort"].at("arm", times), [np.nan, 4.0])
