"""Small traces, models, scenes and scenarios, made by hand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.scenario.model import DrivenRobot, Expectation, Scenario
from sim_action.state.observation import Contact, Observation
from sim_action.state.trace import COLUMNS, Trace
from sim_action.state.verdict import Verdict
from sim_action.world import Body, Physics, Sphere, World
from sim_action.world.scene import Scene

BURGER = "turtlebot3_burger"
WHEELS = ("wheel_left_joint", "wheel_right_joint")
HERE = Workspace(Path("/"), Path("/"))
START = Observation(time=0.0, pose=Pose(), twist=Twist(), joints={})


def column(values: Iterable[Any], width: int) -> FloatArray:
    return np.array(list(values), dtype=np.float64).reshape(-1, width)


def trace(
    time: Sequence[float],
    *,
    x: Sequence[float] | None = None,
    y: Sequence[float] | None = None,
    z: Sequence[float] | None = None,
    roll: Sequence[float] | None = None,
    yaw: Sequence[float] | None = None,
    speed: Sequence[float] | None = None,
    turn_rate: Sequence[float] | None = None,
    position: Sequence[float] | None = None,
    velocity: Sequence[float] | None = None,
    effort: Sequence[float] | None = None,
    contacts: Sequence[Contact] = (),
) -> Trace:
    """A trace of the burger; what is left out is zero. Joint columns are the left wheel's."""
    zeros = [0.0] * len(time)
    turned = zip(roll or zeros, yaw or zeros, strict=True)
    return Trace.of_columns(
        joint_names=WHEELS,
        time=np.array(time, dtype=np.float64),
        base_position_xyz=column(zip(x or zeros, y or zeros, z or zeros, strict=True), 3),
        base_orientation_xyzw=column((quaternion_from_rpy(r, 0.0, w) for r, w in turned), 4),
        base_linear_xyz=column(((v, 0.0, 0.0) for v in speed or zeros), 3),
        base_angular_xyz=column(((0.0, 0.0, w) for w in turn_rate or zeros), 3),
        joint_position=column(((q, 0.0) for q in position or zeros), 2),
        joint_velocity=column(((v, 0.0) for v in velocity or zeros), 2),
        joint_effort=column(((e, 0.0) for e in effort or zeros), 2),
        contacts=tuple(contacts),
    )


def rotation_matrices(orientations_xyzw: FloatArray) -> FloatArray:
    """Of quaternions (T, 4), or of one; by the formula, for oracles."""
    x, y, z, w = orientations_xyzw.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def piece(seen: Trace, start: int, end: int) -> Trace:
    """Rows `start` to `end`, as the loop would hand them over: with the contacts of these steps."""
    rows = seen.rows(slice(start, end))
    inside = set(rows.time.tolist())
    contacts = tuple(touch for touch in seen.contacts if touch.time in inside)
    own = tuple(touch for touch in seen.self_contacts if touch.time in inside)
    if not len(rows):
        return replace(rows, contacts=contacts, self_contacts=own, sensors={}, clearances={})
    first, last, step = float(rows.time[0]), float(rows.time[-1]), float(np.diff(seen.time[:2]).sum())
    return replace(
        rows,
        contacts=contacts,
        self_contacts=own,
        # What is read at a step stands with those that follow it.
        sensors={name: record.between(first - 1.5 * step, last - 0.5 * step) for name, record in seen.sensors.items()},
        clearances={
            watch: record.between(first - 0.5 * step, last + 0.5 * step) for watch, record in seen.clearances.items()
        },
    )


def contact(time: float, body: str = "wall", link: str = "base_footprint", force: float = 12.5) -> Contact:
    return Contact(time, link, body, (1.0, 0.25, 0.1), force)


@cache
def burger() -> RobotModel:
    return load_model(Robot(model=BURGER), HERE)


def scene(model: RobotModel | None = None) -> Scene:
    """The burger, a wall, a ball, and a cube that can move."""
    fixed = Body(name="wall", box=(0.1, 2.0, 0.5)), Body(name="ball", sphere=Sphere(radius=0.1))
    objects = (*fixed, Body(name="cube", box=(0.1, 0.1, 0.1), mass=1.0))
    model = model or burger()
    return Scene(DrivenRobot(model=BURGER), model, World(objects=objects), Physics(), HERE)


def monitor(assertion: Assertion, start: Observation = START, where: Scene | None = None) -> Monitor:
    return assertion.monitor(where or scene(), start)


def states(assertion: Assertion, seen: Trace) -> list[State]:
    """Before the first moment, and after each."""
    opened = monitor(assertion)
    found = [opened.state]
    for index in range(len(seen)):
        opened = opened.observe(piece(seen, index, index + 1))
        found.append(opened.state)
    return found


def judged(assertion: Assertion, seen: Trace, start: Observation = START) -> Verdict:
    """The verdict on a trace, without the count of its moments."""
    return replace(monitor(assertion, start).observe(seen).verdict(), judged=None)


def expectation(assertion: Assertion, **options: Any) -> Expectation:
    return Expectation(assertion, Location("s.sim.yml", 1, 1), assertion.title, **options)


def scenario(*expected: Expectation, time_limit: float = 10.0, duration: float | None = None) -> Scenario:
    return Scenario(
        name="made by hand",
        robot=DrivenRobot(model=BURGER),
        expect=tuple(expected),
        time_limit=time_limit,
        duration=duration,
    )


TOUCHES = (contact(0.1), contact(0.25), contact(0.3))
SEEN = trace(
    [0.1, 0.2, 0.3, 0.4],
    x=[1.0, 2.0, 3.0, 4.0],
    y=[0.0, 0.0, 4.0, 3.0],
    z=[0.0, 0.0, 0.0, 12.0],
    roll=[0.0, 0.5, -1.0, math.pi],
    yaw=[0.0, 1.0, 3.0, -3.0],
    speed=[1.0, -2.0, 0.0, 0.5],
    turn_rate=[0.0, -0.5, 0.0, 0.0],
    position=[0.0, 0.1, 0.2, 0.3],
    velocity=[1.0, 1.0, 1.0, 1.0],
    effort=[0.0, 0.0, 0.0, 9.0],
    contacts=TOUCHES,
)


def columns(seen: Trace) -> dict[str, Any]:
    return {name: getattr(seen, name) for name in COLUMNS}


def assert_same(one: Trace, other: Trace) -> None:
    assert one.joint_names == other.joint_names
    assert one.contacts == other.contacts
    for name, values in columns(one).items():
        np.testing.assert_array_equal(values, columns(other)[name], strict=True)
