"""Robots in worlds that are more than a plane, from the text of a scenario to its verdict, on every engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_action.core.errors import BadStart
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine, running
from tests.simulated import simulated
from tests.worlds import write_map

pytestmark = on_every_engine

SCENARIO = """
name: it
robot: {{model: turtlebot3_burger, pose: {pose}}}
world: {world}
commands: {{rate: 10 Hz, twist: [{twist}]}}
sensors: [{sensor}]
expect: [upright]
allow: [{allow}]
duration: {seconds} s
time_limit: {seconds} s
backend: {engine}
"""
DEFAULTS = {"pose": "{}", "world": "{}", "twist": "{linear: 0.2}", "sensor": "imu", "seconds": 5, "allow": ""}


def run(engine: str, folder: Path, **said: object) -> SimulationRun:
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    return simulated(folder, SCENARIO.format(**{**DEFAULTS, **said, "engine": engine}))


def came(run: SimulationRun) -> tuple[float, float]:
    """How far in x, and how high, the base link."""
    moved = run.trace.base_position_xyz[-1] - run.trace.base_position_xyz[0]
    return float(moved[0]), float(moved[2])


def test_stairs_stop_a_burger_and_are_what_it_touched(engine: str, tmp_path: Path) -> None:
    stairs = "{steps: 5, rise: 8 cm, run: 30 cm, width: 1 m}"
    world = f"{{objects: [{{name: stairs, stairs: {stairs}, pose: {{x: 1.25}}}}]}}"
    ahead, up = came(run(engine, tmp_path, world=world))
    # The foremost part of it are its wheels.
    assert ahead == pytest.approx(0.5 - 0.033, abs=0.03)
    assert abs(up) < 0.01


def test_a_robot_on_the_moon_stands_as_high_and_feels_less(engine: str, tmp_path: Path) -> None:
    earth, moon = (
        run(engine, tmp_path, world=f"{{gravity: {gravity}}}", sensor="{imu: {}, trace: true}", twist="{linear: 0}")
        for gravity in ("9.80665", "1.62 m/s^2")
    )
    heights = [found.trace.base_position_xyz[-1, 2] for found in (earth, moon)]
    assert heights[1] == pytest.approx(heights[0], abs=1e-4)
    # MuJoCo comes to rest as springs do.
    felt = [found.trace.sensors["imu"].columns["linear_acceleration_xyz"][-1] for found in (earth, moon)]
    assert felt[0] == pytest.approx([0, 0, 9.80665], abs=0.02)
    assert felt[1] == pytest.approx([0, 0, 1.62], abs=0.02)


def test_without_gravity_wheels_turn_and_nothing_moves(engine: str, tmp_path: Path) -> None:
    floats = run(engine, tmp_path, world="{gravity: 0}")
    assert came(floats) == pytest.approx((0, 0), abs=0.02)
    assert not [note for note in floats.notes if "not at rest" in note]


def test_a_body_that_begins_in_another_is_told_with_its_line(engine: str, tmp_path: Path) -> None:
    # A wedge: what is none of boxes, balls and cylinders is not looked at before it runs.
    wall = "{name: wall, ramp: {length: 1, width: 1, height: 1}, pose: {x: 3}}"
    world = f"{{objects: [{wall}, {{name: ball, sphere: {{radius: 0.1}}, mass: 1, pose: {{x: 3.3, z: 0.5}}}}]}}"
    with pytest.raises(BadStart, match=r"'ball' begins .* deep in 'wall'") as caught:
        run(engine, tmp_path, world=world)
    assert caught.value.by_keys[0][0] == ("world", "objects", 1, "pose")
    notes = run(engine, tmp_path, world=world, seconds=1, allow="overlapping-bodies").notes
    (note,) = (note for note in notes if "deep" in note)
    assert note.startswith("1 body begins inside another, and the engine throws it out: 'ball' begins 0.")
    lies = world.replace("z: 0.5", "z: 1.1")
    assert run(engine, tmp_path, world=lies, seconds=1).sim_time == 1


def test_two_bodies_in_each_other_are_told_once(engine: str, tmp_path: Path) -> None:
    # Their edges alone touch, beside the boxes and balls inside them.
    can = "cylinder: {radius: 0.1, height: 0.1}, mass: 1, pose: {z: 1, x: "
    with pytest.raises(BadStart) as caught:
        run(engine, tmp_path, world=f"{{objects: [{{name: a, {can}3}}}}, {{name: b, {can}3.16}}}}]}}")
    assert len(caught.value.by_keys) == 1


def test_a_robot_below_a_heightfield_is_told(engine: str, tmp_path: Path) -> None:
    field = "{heights: [[0, 0.5, 0], [0, 0.5, 0], [0, 0.5, 0]], size: [4, 4]}"
    with pytest.raises(BadStart, match="below the surface of 'hill'; raise its z"):
        run(engine, tmp_path, world=f"{{objects: [{{name: hill, heightfield: {field}}}]}}")


ROOM = np.full((60, 60), 254)
ROOM[[0, -1], :] = ROOM[:, [0, -1]] = 0
CAMERA = "{camera: {width: 81, height: 61}, pose: {x: 0.2, z: 0.23}, trace: true}"


@pytest.mark.parametrize(
    ("shape", "at"),
    [
        ("stairs: {steps: 10, rise: 10 cm, run: 20 cm, width: 1}, pose: {x: 2}", 1.4),
        ("ramp: {length: 2, width: 1, height: 0.5}, pose: {x: 2}", 1 + 0.23 * 4),
        ("map: {file: map.yaml, height: 1 m}", 1.95),
        ("mesh: {file: sheet.obj}, pose: {x: 1.5}", 1.5),
        ("heightfield: {heights: [[0, 1], [0, 1]], size: [2, 2]}, pose: {x: 2}", 1 + 0.23 * 2),
    ],
)
def test_cameras_and_rays_see_what_there_is(engine: str, shape: str, at: float, tmp_path: Path) -> None:
    write_map(tmp_path, ROOM, resolution=0.05, origin=[-1, -1.5, 0])
    (tmp_path / "sheet.obj").write_text("v 0 -1 0\nv 0 1 0\nv 0 1 1\nv 0 -1 1\nf 1 2 3\nf 1 3 4\n")
    world = f"{{objects: [{{name: it, {shape}}}]}}"
    trace = run(engine, tmp_path, world=world, twist="{linear: 0}", seconds=1, sensor=CAMERA).trace
    x, y, z = trace.base_position_xyz[-1] + (0.2, 0.0, 0.23)
    seen = x + trace.sensors["camera"].columns["depth"][-1][30, 40]
    with running(engine, build_scene(load_scenario(tmp_path / "s.sim.yml"))) as backend:
        hit = x + 10 * backend.cast_rays((x, y, z), np.array([[x + 10, y, z]]))[0]
    assert (seen, hit) == pytest.approx((at, at), abs=0.02)
    assert seen == pytest.approx(hit, abs=6e-3)
