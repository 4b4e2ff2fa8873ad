"""What a push comes to, and what happens when, seen by a control that writes it down; tests/integration has physics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Twist, Vector3, quaternion_from_rpy
from sim_action.core.records import replace
from sim_action.engines.body_control import RobotInertia, Target, WorldEvents, base_wrench
from sim_action.state.command import BasePush
from sim_action.world import Physics, World
from tests import traces

ROBOT = RobotInertia(mass=4.0, inertia=0.5)
speeds = st.floats(-3, 3)


def push(ahead: float, left: float, turn: float, most: float = 1e9) -> BasePush:
    return BasePush((ahead, left), turn, (0.1, 0.0, -0.2), max_force=most, max_torque=most)


@given(st.tuples(speeds, speeds, speeds), st.tuples(speeds, speeds, speeds))
def test_unlimited_it_gives_what_lacks(wanted: tuple[float, float, float], now: tuple[float, float, float]) -> None:
    found = base_wrench(push(*wanted), ROBOT, Pose(), Twist((*now[:2], 1.0), (1.0, 1.0, now[2])), 0.1)
    missing = [goal - has for goal, has in zip(wanted, now, strict=True)]
    assert found.force_xyz == pytest.approx((40 * missing[0], 40 * missing[1], 0.0), abs=1e-9)
    assert found.torque_xyz == pytest.approx((0.0, 0.0, 5 * missing[2]), abs=1e-9)


@given(speeds, speeds, speeds, st.floats(0, 10))
def test_it_is_as_strong_as_allowed_and_goes_its_way(ahead: float, left: float, turn: float, most: float) -> None:
    whole = base_wrench(push(ahead, left, turn), ROBOT, Pose(), Twist(), 0.1)
    found = base_wrench(push(ahead, left, turn, most), ROBOT, Pose(), Twist(), 0.1)
    assert math.hypot(*found.force_xyz) <= most * (1 + 1e-9)
    assert abs(found.torque_xyz[2]) <= most
    (x, y, _), (wanted_x, wanted_y, _) = found.force_xyz, whole.force_xyz
    assert x * wanted_y == pytest.approx(y * wanted_x, abs=1e-6)
    assert x * wanted_x + y * wanted_y >= 0


def test_a_push_is_level_ahead_and_at_a_point_of_the_base() -> None:
    pose = Pose((1.0, 2.0, 0.5), quaternion_from_rpy(0.0, 0.0, math.pi / 2))
    found = base_wrench(push(1.0, 0.0, 0.0), ROBOT, pose, Twist(), 0.1)
    assert found.force_xyz == pytest.approx((0.0, 40.0, 0.0))
    assert found.point_xyz == pytest.approx((1.0, 2.1, 0.3))
    pose = Pose(orientation_xyzw=quaternion_from_rpy(0.0, 0.3, 0.0))
    assert base_wrench(push(1.0, 0.0, 0.0), ROBOT, pose, Twist(), 0.1).force_xyz == pytest.approx((40.0, 0.0, 0.0))


@dataclass
class WrittenDown:
    """A control on which bodies stand 0.5 m high."""

    puts: list[tuple[str, Pose, Twist]] = field(default_factory=list)
    forces: list[tuple[Target, Vector3, Vector3, Vector3 | None]] = field(default_factory=list)
    pushes: list[tuple[Target, Vector3]] = field(default_factory=list)
    pulls: list[tuple[Target, float]] = field(default_factory=list)
    loads: list[tuple[str, float]] = field(default_factory=list)
    frictions: list[tuple[int, float]] = field(default_factory=list)
    releases: int = 0

    def pose(self, body: str) -> Pose:
        return Pose((1.0, 2.0, 0.5))

    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        self.puts.append((body, pose, twist))

    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        self.forces.append((target, force_xyz, torque_xyz, point_xyz))

    def attract(self, target: Target, force: float) -> None:
        self.pulls.append((target, force))

    def clear_forces(self) -> None:
        self.releases += 1

    def add_mass(self, link: str, mass: float) -> None:
        self.loads.append((link, mass))

    def scale_friction(self, patch: int, factor: float) -> None:
        self.frictions.append((patch, factor))

    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        self.pushes.append((target, velocity_xyz))


def opened(rate: float = 100.0, **world: Any) -> tuple[WrittenDown, WorldEvents]:
    control = WrittenDown()
    scene = replace(traces.scene(), world=World.model_validate(world), physics=Physics(rate=rate))
    events = WorldEvents.of(scene, control)
    assert events is not None
    return control, events


def go(events: WorldEvents, first: int, last: int) -> None:
    for step in range(first, last):
        events.before_step(step)
        events.after_step(step + 1)


def test_where_nothing_happens_there_is_no_timetable() -> None:
    assert WorldEvents.of(traces.scene(), WrittenDown()) is None


@given(st.floats(0, 0.5), st.floats(1e-4, 0.3), st.floats(30, 1000))
def test_forces_act_for_as_long_as_is_said_at_any_rate(at: float, seconds: float, rate: float) -> None:
    control, events = opened(rate, disturbances=({"at": at, "for": seconds, "force": (3, 0, 0)},))
    go(events, -5, math.ceil(rate))
    assert sum(force[0] for _, force, _, _ in control.forces) / rate == pytest.approx(3 * seconds, rel=1e-3)
    assert all(0 <= force[0] <= 3 * (1 + 1e-9) for _, force, _, _ in control.forces)


@given(st.floats(0, 0.9), st.floats(30, 1000))
def test_a_push_comes_once_at_the_first_step_of_its_time(at: float, rate: float) -> None:
    control, events = opened(rate, disturbances=({"at": at, "velocity": (0, 1, 0)},))
    first = math.ceil(at * rate - 1e-6)
    go(events, -5, first)
    assert control.pushes == []
    go(events, first, first + 20)
    assert control.pushes == [(Target("base_footprint", is_link=True), (0.0, 1.0, 0.0))]


def test_a_disturbance_is_of_what_it_names() -> None:
    force = {"at": 0, "for": 1, "force": (1, 0, 0), "point": (0, 0, 1)}
    control, events = opened(disturbances=({**force, "link": "base_scan"}, {**force, "body": "ball"}))
    go(events, 0, 1)
    assert [target for target, *_ in control.forces] == [
        Target("base_scan", is_link=True),
        Target("ball", is_link=False),
    ]
    assert control.forces[0][3] == (0.0, 0.0, 1.0)
    assert control.releases == 2  # at the beginning and after the step


def test_a_body_on_a_path_moves_with_what_brings_it_to_its_next_place() -> None:
    path = ({"at": 0.1, "x": 0}, {"at": 0.2, "x": 1, "yaw": 0.5})
    control, events = opened(objects=({"name": "gate", "box": (1, 1, 1), "pose": {"y": 2}, "path": path},))
    assert control.puts == [("gate", Pose((0.0, 2.0, 0.5)), Twist())]
    go(events, -20, 10)
    # It rests until then, which costs nothing; from step 10 on it moves.
    (_, pose, twist) = control.puts[-1]
    assert len(control.puts) == 2
    assert pose == Pose((0.0, 2.0, 0.5))
    assert twist.linear_xyz == pytest.approx((10.0, 0.0, 0.0))
    assert twist.angular_xyz == pytest.approx((0.0, 0.0, 5.0))
    go(events, 10, 60)
    (_, pose, twist) = control.puts[-1]
    assert pose.position_xyz == pytest.approx((1.0, 2.0, 0.5))
    assert twist == Twist()
    assert len(control.puts) == 12


def test_a_body_that_is_not_there_yet_is_held_far_away_and_let_go_once() -> None:
    control, events = opened(objects=({"name": "ball", "sphere": {"radius": 1}, "mass": 1, "appears": 0.05},))
    go(events, 0, 4)
    assert {pose.position_xyz[2] for _, pose, _ in control.puts} == {1e6}
    go(events, 4, 20)
    assert control.puts[-1] == ("ball", Pose((1.0, 2.0, 0.5)), Twist())
    assert [pose.position_xyz[2] for _, pose, _ in control.puts].count(0.5) == 1


def test_bodies_and_patches_come_and_go_at_the_steps_of_their_times() -> None:
    ball = {"name": "ball", "sphere": {"radius": 1}, "mass": 1, "appears": 0.02, "disappears": 0.05}
    ice = {"size": (1, 2), "friction": 0.1, "appears": 0.03}
    control, events = opened(objects=(ball,), patches=(ice,), ground={"friction": 0.5})
    heights, frictions = [], []
    for step in range(6):
        go(events, step, step + 1)
        heights.append(control.puts[-1][1].position_xyz[2])
        frictions.append(len(control.frictions))
    assert heights == [1e6, 0.5, 0.5, 0.5, 1e6, 1e6]
    assert frictions == [0, 0, 1, 1, 1, 1]
    assert dict(control.frictions) == pytest.approx({0: 0.2})


def test_a_belt_moves_from_the_start_on() -> None:
    belt = {"name": "belt", "box": (1, 1, 1), "surface_velocity": {"linear": (0.3, 0, 0)}}
    scene, control = replace(traces.scene(), world=World.model_validate({"objects": (belt,)})), WrittenDown()
    events = WorldEvents.of(scene, control, drives_surfaces=True)
    assert events is not None
    go(events, -3, 2)
    assert [twist.linear_xyz[0] for _, _, twist in control.puts if twist != Twist()] == pytest.approx([0.3] * 3)
    assert control.puts[0][2] == control.puts[2][2] == Twist()


def test_a_payload_is_put_on_and_taken_off_once() -> None:
    load = {"payload": 2.0, "link": "base_link", "at": 0.1, "for": 0.05}
    control, events = opened(disturbances=(load, {"payload": -0.5, "at": 0.12}))
    go(events, 0, 10)
    assert control.loads == [("base_link", 2.0)]
    go(events, 10, 40)
    assert control.loads == [("base_link", 2.0), (traces.burger().root, -0.5), ("base_link", -2.0)]
    assert not control.forces


def test_adhesion_acts_for_its_time_and_its_share_of_a_step() -> None:
    control, events = opened(10, disturbances=({"adhesion": 4.0, "at": 0.1, "for": 0.15},))
    go(events, 0, 5)
    assert {target for target, _ in control.pulls} == {Target("base_footprint", is_link=True)}
    assert [force for _, force in control.pulls] == pytest.approx([4.0, 2.0])
    control, events = opened(10, disturbances=({"adhesion": 4.0, "at": 0.3},))
    go(events, 0, 5)
    assert [force for _, force in control.pulls] == pytest.approx([4.0, 4.0])
