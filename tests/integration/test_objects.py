"""Poses of bodies at every step, on every engine: they are right, and recording them does not change the run."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.trace_records import Channels
from tests.integration.engines import on_every_engine
from tests.scenarios import load
from tests.traces import expectation

BUSY = """\
name: burger among things that move
robot: {{model: turtlebot3_burger}}
physics: {{settle: 0}}
world:
  objects:
    - {{name: wall, box: [0.1, 2.0, 0.5], pose: {{x: 3}}}}
    - {{name: ball, sphere: {{radius: 10 cm}}, mass: 100 g, pose: {{x: -1, z: 5}}}}
    - {{name: door, box: [0.1, 0.5, 0.5], pose: {{y: 1}}, path: [{{at: 0.25, y: 1}}, {{at: 0.5, y: 2}}]}}
    - {{name: parcel, box: [0.1, 0.1, 0.1], mass: 1 kg, pose: {{x: -2, z: 2}}, appears: 0.25 s}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.2}}]}}
expect: [upright]
time_limit: 0.6 s
trace: {{rate: {rate}}}
backend: {engine}
"""


class Watching(Upright):
    """Reads the poses of four bodies."""

    key: ClassVar[str] = "upright"

    @property
    def channels(self) -> Channels:
        return Channels(objects=frozenset({"wall", "ball", "door", "parcel"}))


def run(tmp_path: Path, engine: str, *, watching: bool = True, rate: str = "240 Hz") -> SimulationRun:
    loaded = load(tmp_path, BUSY.format(engine=engine, rate=rate))
    watched = loaded.scenario.model_copy(update={"expect": (expectation(Watching()),)})
    return simulate(watched if watching else loaded.scenario, build_scene(loaded), lambda _: None)


@on_every_engine
def test_objects_have_a_pose_at_every_step(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, engine).trace
    assert len(trace) == 145
    assert all((record.time == trace.time).all() for record in trace.objects.values())
    ball, door, parcel = (trace.objects[name].position_xyz for name in ("ball", "door", "parcel"))
    steps = np.arange(145)
    fallen = 9.80665 / 240**2 * steps * (steps + 1) / 2
    assert ball[:, 2] == pytest.approx(5.0 - fallen, abs=1e-6)
    assert door[:, 1] == pytest.approx(1 + np.clip((trace.time - 0.25) / 0.25, 0, 1), abs=1e-6)
    assert (np.isnan(parcel).all(axis=1) == (steps < 60)).all()
    assert parcel[60:, 2] == pytest.approx(2.0 - fallen[:85], abs=1e-6)
    assert trace.objects["wall"].position_xyz == pytest.approx(np.tile([3.0, 0.0, 0.25], (145, 1)))


@on_every_engine
def test_objects_of_a_thinned_trace_have_its_times(engine: str, tmp_path: Path) -> None:
    full, thinned = run(tmp_path, engine), run(tmp_path, engine, rate="24 Hz")
    assert len(thinned.trace) == 16
    for name, record in thinned.trace.objects.items():
        assert (record.time == thinned.trace.time).all()
        every = full.trace.objects[name].rows(np.searchsorted(full.trace.time, record.time))
        np.testing.assert_array_equal(record.position_xyz, every.position_xyz)
        np.testing.assert_array_equal(record.orientation_xyzw, every.orientation_xyzw)


@on_every_engine
def test_a_run_with_objects_is_the_same_run(engine: str, tmp_path: Path) -> None:
    watching, plain = run(tmp_path, engine), run(tmp_path, engine, watching=False)
    assert watching.digest == plain.digest
    assert plain.trace.objects == {}
