"""Assertions on links barely pass and barely fail, in the world and in moving frames, against matrices and rotations.

A free body with an arm falls and turns. The oracle computes the poses of its links with 4 x 4 matrices from the state
of the base and the joints, and velocities from differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.simulation.loop import SimulationRun
from sim_action.state.trace import Trace
from tests.integration.engines import on_every_engine
from tests.integration.test_probe import INERTIAL
from tests.simulated import simulated
from tests.traces import rotation_matrices

_LIMIT: Final = '<limit lower="-3" upper="3" effort="50" velocity="10"/>'
MODEL: Final = f"""\
<robot name="flyer">
  <link name="body">{INERTIAL}</link>
  <joint name="shoulder" type="revolute"><parent link="body"/><child link="arm"/>
    <origin xyz="0.1 0.05 0.2" rpy="0.3 0 0.4"/><axis xyz="0 1 0"/>{_LIMIT}</joint>
  <link name="arm">{INERTIAL}</link>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/>
    <origin xyz="0.3 0 0" rpy="0 0.5 0"/><axis xyz="1 0 0"/>{_LIMIT}</joint>
  <link name="hand">{INERTIAL}</link>
  <joint name="wrist" type="revolute"><parent link="hand"/><child link="tool"/>
    <origin xyz="0.1 0 0.05" rpy="0 1.2 0.7"/><axis xyz="1 0 0"/>{_LIMIT}</joint>
  <link name="tool">{INERTIAL}</link>
</robot>
"""
JOINTS: Final = ("shoulder", "slide", "wrist")
END_S: Final = 0.4
WATCHED: Final = [("tool", "world"), ("tool", "base"), ("tool", "arm"), (None, "hand")]
"""Links, each with the frame from which it is seen; None is the base."""

Rows = FloatArray


def rotation(axis: str, angle: float) -> Rows:
    """Return a 4 x 4 matrix."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    found = np.eye(4)
    found[first, first] = found[second, second] = math.cos(angle)
    found[second, first], found[first, second] = math.sin(angle), -math.sin(angle)
    return found


def placed(xyz: Vector3, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Rows:
    found = rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    found[:3, 3] = xyz
    return found


def base_matrix(state: Rows) -> Rows:
    found = np.eye(4)
    found[:3, :3] = rotation_matrices(state[3:7])
    found[:3, 3] = state[:3]
    return found


def forward(base: Rows, shoulder: float, slide: float, wrist: float) -> dict[str, Rows]:
    arm = base @ placed((0.1, 0.05, 0.2), 0.3, 0.0, 0.4) @ rotation("y", shoulder)
    hand = arm @ placed((0.3, 0.0, 0.0), 0.0, 0.5) @ placed((slide, 0.0, 0.0))
    tool = hand @ placed((0.1, 0.0, 0.05), 0.0, 1.2, 0.7) @ rotation("x", wrist)
    return {"world": np.eye(4), "base": base, "arm": arm, "hand": hand, "tool": tool}


def turned_by(vector: Rows) -> Rows:
    """Return the 3 x 3 rotation by a rotation vector."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


class Watched:
    """The poses of a link in a frame at each step, and its speeds there."""

    def __init__(self, trace: Trace, link: str | None, frame: str) -> None:
        at = {name: trace.joint_names.index(name) for name in JOINTS}
        self.time = trace.time

        def relative(row: int, ahead: float) -> Rows:
            """Return the pose if all velocities of a step went on for `ahead` s."""
            base = base_matrix(trace.state[row, 1:8])
            base[:3, :3] = turned_by(trace.base_angular_xyz[row] * ahead) @ base[:3, :3]
            base[:3, 3] += trace.base_linear_xyz[row] * ahead
            joints = (
                float(trace.joint_position[row, at[name]] + trace.joint_velocity[row, at[name]] * ahead)
                for name in JOINTS
            )
            poses = forward(base, *joints)
            return np.asarray(np.linalg.inv(poses[frame]) @ poses[link or "base"])

        rows = range(len(trace))
        self.poses = np.array([relative(row, 0.0) for row in rows])
        h = 1e-5
        steps = [(relative(row, h) - relative(row, -h)) / (2 * h) for row in rows]
        self.speed = np.linalg.norm(np.array(steps)[:, :3, 3], axis=1)
        spins = np.einsum("tij,tkj->tik", np.array(steps)[:, :3, :3], self.poses[:, :3, :3])
        self.turn_rate = np.sqrt(spins[:, 2, 1] ** 2 + spins[:, 0, 2] ** 2 + spins[:, 1, 0] ** 2)
        self.place = self.poses[:, :3, 3]

    def distance(self, point: Rows) -> Rows:
        return np.asarray(np.linalg.norm(self.place - point, axis=1))


def angles_of(matrix: Rows) -> dict[str, str]:
    found = {
        "roll": math.atan2(matrix[2, 1], matrix[2, 2]),
        "pitch": -math.asin(matrix[2, 0]),
        "yaw": math.atan2(matrix[1, 0], matrix[0, 0]),
    }
    return {name: f"{angle!r} rad" for name, angle in found.items()}


Case = tuple[Callable[[float], dict[str, Any]], float, float]
"""An assertion by its limit, the least limit that passes, and its uncertainty."""


def cases(seen: Watched) -> list[Case]:
    middle = len(seen.time) // 2
    aside = seen.place[middle] + (0.01, -0.02, 0.03)
    x, y, z = aside.tolist()
    here_x, here_y, here_z = seen.place[middle].tolist()
    end_x, _, end_z = seen.place[-1].tolist()
    off = angles_of(seen.poses[middle, :3, :3] @ turned_by(np.array((0.06, -0.08, 0.05))))
    off_by = math.sqrt(0.06**2 + 0.08**2 + 0.05**2)
    off_at_end = angles_of(turned_by(np.array((0.0, 0.3, 0.4))) @ seen.poses[-1, :3, :3])
    heading = math.atan2(seen.poses[-1, 1, 0], seen.poses[-1, 0, 0])
    # It is behind the beginning of a path that leads away from it.
    start, path = seen.place[0], seen.place[0] + np.array(((5.0, 0.1, 0.2), (6.0, 0.1, 0.2)))
    assert (seen.place[:, 0] < path[0, 0]).all()
    tilt = np.arccos(seen.poses[:, 2, 2])

    def reaches(at: float) -> dict[str, Any]:
        turned = {**off, "tolerance": f"{at!r} rad"}
        return {"reach": {"x": here_x, "y": here_y, "z": here_z, "tolerance": 1e-9, "orientation": turned}}

    points = [dict(zip("xyz", point.tolist(), strict=True)) for point in path]
    return [
        (lambda at: {"reach": {"x": x, "y": y, "z": z, "tolerance": at}}, seen.distance(aside).min(), 1e-9),
        (lambda at: {"reach": {"x": x, "y": y, "tolerance": at}}, np.hypot(*(seen.place - aside)[:, :2].T).min(), 1e-9),
        (reaches, off_by, 1e-8),
        (lambda at: {"final_pose": {"x": end_x + 0.3, "z": end_z - 0.4, "tolerance": at}}, 0.5, 1e-9),
        (lambda at: {"final_pose": {"orientation": {**off_at_end, "tolerance": f"{at!r} rad"}}}, 0.5, 1e-8),
        (lambda at: {"final_pose": {"yaw": f"{heading + 0.25!r} rad", "yaw_tolerance": f"{at!r} rad"}}, 0.25, 1e-8),
        (lambda at: {"stay_within": {"y": [-9, at]}}, seen.place[:, 1].max(), 1e-9),
        (lambda at: {"max_speed": {"linear": at}}, seen.speed.max(), 1e-6),
        (lambda at: {"max_speed": {"angular": f"{at!r} rad/s"}}, seen.turn_rate.max(), 1e-6),
        (lambda at: {"travel": {"at_most": at}}, np.hypot(*(seen.place - start)[:, :2].T).max(), 1e-9),
        (lambda at: {"path_length": {"at_most": at}}, np.linalg.norm(np.diff(seen.place, axis=0), axis=1).sum(), 1e-9),
        (lambda at: {"upright": {"max_tilt": f"{at!r} rad"}}, tilt.max(), 1e-7),
        (lambda at: {"follow_path": {"path": points, "max_error": at}}, seen.distance(path[0]).max(), 1e-9),
    ]


def ran(folder: Path, engine: str, expected: list[dict[str, Any]]) -> SimulationRun:
    (folder / "flyer.urdf").write_text(MODEL)
    scenario = {
        "name": "flyer",
        "robot": {"model": "flyer.urdf", "pose": {"z": 5, "roll": 0.2}},
        "commands": {
            "joints": [
                {"at": END_S / 2, "position": {"shoulder": 0.8, "slide": 0.2, "wrist": 0.5}},
                {"at": END_S, "position": {"shoulder": -0.3, "slide": -0.1, "wrist": -0.4}},
            ],
            "rate": "240 Hz",
        },
        "physics": {"settle": 0},
        "trace": {"rate": "240 Hz"},
        # A warning does not end the run, so each expectation sees all of it.
        "expect": [{**one, "severity": "warning"} for one in expected],
        "allow": ["warnings-only", "unreachable-limit"],
        "duration": END_S,
        "time_limit": END_S,
        "backend": engine,
    }
    return simulated(folder, scenario)


def on(link: str | None, frame: str, assertion: dict[str, Any]) -> dict[str, Any]:
    ((key, value),) = assertion.items()
    return {key: {**value, "frame": frame, **({} if link is None else {"link": link})}}


@on_every_engine
def test_links_in_frames_barely_pass_and_barely_fail(engine: str, tmp_path: Path) -> None:
    free = ran(tmp_path, engine, [{"travel": {"at_most": 100}}])
    wanted: list[tuple[dict[str, Any], bool]] = []
    for link, frame in WATCHED:
        for asked, limit, uncertain in cases(Watched(free.trace, link, frame)):
            for passes in (True, False):
                at = float(limit) + (uncertain if passes else -uncertain)
                wanted.append((on(link, frame, asked(at)), passes))
    run = ran(tmp_path, engine, [spec for spec, _ in wanted])
    assert run.digest == free.digest
    wrong = [
        (spec, verdict.message)
        for (spec, passes), verdict in zip(wanted, run.verdicts, strict=True)
        if verdict.passed is not passes
    ]
    assert wrong == []
    assert len(wanted) == 2 * 13 * len(WATCHED)
