"""What is kept of a run for its replay, on every engine: it changes nothing, and what moves is where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_action.core.errors import SimulationUnstable
from sim_action.recording.replay.build import make_replay, replay_of, stored_signals
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.trace import Trace
from tests.integration.engines import on_every_engine
from tests.scenarios import LEAST, load

BUSY = """\
name: burger among things that move
robot: {{model: turtlebot3_burger}}
world:
  objects:
    - {{name: wall, box: [0.1, 2.0, 0.5], pose: {{x: 0.45}}}}
    - {{name: ball, sphere: {{radius: 10 cm}}, mass: 100 g, pose: {{x: -1, z: 1}}}}
    - {{name: door, box: [0.1, 0.5, 0.5], pose: {{y: 1}}, path: [{{at: 0.5, y: 1}}, {{at: 1.5, y: 2}}]}}
    - {{name: parcel, box: [0.1, 0.1, 0.1], mass: 1 kg, pose: {{x: -2, z: 2}}, appears: 1 s}}
    - {{name: sign, box: [0.1, 0.1, 0.1], pose: {{x: -3}}, appears: 1 s}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.5}}]}}
expect: [{{travel: {{at_least: 5 m}}}}]
time_limit: 2.01 s
backend: {engine}
"""


def filmed(loaded: LoadedScenario, *, asked: bool = True) -> tuple[SimulationRun, Trace | None]:
    footage = RunRecorder(loaded.scenario, filmed=asked)
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None, footage)
    return run, footage.film()


@on_every_engine
def test_a_run_that_is_filmed_is_the_same_run(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, BUSY.format(engine=engine))
    (filming, film), (plain, nothing) = filmed(loaded), filmed(loaded, asked=False)
    assert filming.digest == plain.digest
    assert (filming.trace.state == plain.trace.state).all()
    assert filming.trace.contacts == plain.trace.contacts == ()
    assert nothing is None
    assert plain.trace.bodies == {}
    assert film is not None
    assert len(film) == 62  # 30 a second, the first and the last


@on_every_engine
def test_what_moves_is_where_it_was(engine: str, tmp_path: Path) -> None:
    run, _ = filmed(load(tmp_path, BUSY.format(engine=engine)))
    assert sorted(run.trace.bodies) == ["ball", "door", "parcel"]
    ball, door = run.trace.bodies["ball"], run.trace.bodies["door"]
    assert door.position_xyz[:, 1] == pytest.approx(1 + np.clip(door.time - 0.5, 0, 1), abs=1e-6)
    assert np.diff(door.time)[1:] == pytest.approx(np.full(len(door) - 2, 1 / 30))
    assert run.sim_time - door.time[-1] < 1 / 30
    assert ball.position_xyz[0, 2] - ball.position_xyz[-1, 2] > 0.1
    assert ball.position_xyz[-1, 2] == pytest.approx(0.1, abs=0.01)
    assert np.linalg.norm(ball.orientation_xyzw, axis=1) == pytest.approx(np.ones(len(ball)))


@on_every_engine
def test_a_replay_has_everything_at_its_place(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, BUSY.format(engine=engine))
    _, film = filmed(loaded)
    assert film is not None
    replay = replay_of(build_scene(loaded), film)
    frames, bodies = replay.frames, {body.name: body for body in replay.scene.bodies}
    time = frames.time.decoded(frames.count)
    assert (time[0], time[-1]) == (0.0, pytest.approx(2.0125))
    track = bodies["parcel"].track
    assert track is not None
    height = frames.tracks[track][2].decoded(frames.count)
    assert height[time < 1.0] == pytest.approx(2.0, abs=1e-3)  # nobody sees where it waits
    assert height[-1] < 0.5
    assert (bodies["sign"].track, bodies["sign"].appears, bodies["wall"].track) == (None, 1.0, None)
    touches = {(replay.scene.links[touch.link].name, replay.scene.bodies[touch.body].name) for touch in replay.contacts}
    assert touches == {("base_footprint", "wall")}


SEEN_OBJECTS = """\
name: assertions about objects, feet and links that touch
robot: {{model: turtlebot3_burger}}
world:
  objects:
    - {{name: ball, sphere: {{radius: 10 cm}}, mass: 100 g, pose: {{x: -1, z: 1}}}}
    - {{name: parcel, box: [0.1, 0.1, 0.1], mass: 1 kg, pose: {{x: -2, z: 0.5}}, appears: 0.3 s}}
    - {{name: sign, box: [0.1, 0.1, 0.1], pose: {{x: -3}}}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.1}}]}}
expect:
  - {{stl: always (ball.z < 1.1 m)}}
  - {{stl: "eventually (distance(base_footprint, parcel) < 3 m)"}}
  - {{object: {{name: ball, stay_within: {{z: [0, 1.1]}}}}}}
time_limit: 0.5 s
duration: 0.5 s
backend: {engine}
"""


@on_every_engine
def test_assertions_about_objects_have_curves_in_the_replay(engine: str, tmp_path: Path) -> None:
    loaded = load(tmp_path, SEEN_OBJECTS.format(engine=engine))
    scene = build_scene(loaded)
    footage = RunRecorder(loaded.scenario, filmed=True)
    run = simulate(loaded.scenario, scene, lambda _: None, footage)
    film = footage.film()
    assert film is not None
    assert footage.start is not None
    assert {len(record) for record in film.objects.values()} == {len(film)}
    make_replay(loaded.scenario, scene, footage.start, film, tmp_path / "run.html")
    curves = stored_signals(loaded.scenario, scene, footage.start, film)
    assert {curve.expectation for curve in curves} == {0, 1, 2}
    assert all(verdict.passed for verdict in run.verdicts)
    height = next(curve for curve in curves if curve.expectation == 0 and curve.name != "robustness")
    fallen, ball = height.values.decoded(len(film)), film.bodies["ball"].position_xyz[:, 2]
    assert fallen[0] == pytest.approx(ball[0], abs=0.02)
    assert fallen[-1] == pytest.approx(ball[-1], abs=0.1)


def test_what_explodes_has_been_seen_until_then(tmp_path: Path) -> None:
    # It speeds up by 1 m/s^2.
    loaded = load(tmp_path, f"{LEAST}physics: {{max_speed: 0.3 m/s}}\n")
    footage = RunRecorder(loaded.scenario, filmed=True)
    with pytest.raises(SimulationUnstable):
        simulate(loaded.scenario, build_scene(loaded), lambda _: None, footage)
    film = footage.film()
    assert film is not None
    assert film.time[-1] == pytest.approx(0.3, abs=0.06)
