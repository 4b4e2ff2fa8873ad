"""Limits of contact forces and impulses on real engines: what they measure, and that the rate does not matter."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.assertions.contact import Touch
from sim_action.assertions.monitors.contacts import MeanForce
from sim_action.core.field_types import Placement
from sim_action.engines import installed
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import simulate
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, Body, Ground, World
from tests.integration.engines import advance, at, one_link, running, scene_of, travelled
from tests.scenarios import load
from tests.simulated import simulated
from tests.traces import START

every_engine = pytest.mark.parametrize("engine", installed())
RATES = (120, 480, 1920)
MASS, SPEED = 2.0, 0.5

BALL = one_link('<sphere radius="0.1"/>', mass=MASS, moment=0.008)
CRATE = one_link('<box size="0.2 0.2 0.2"/>', mass=MASS, moment=0.008)
WALL = Body(name="wall", box=(0.1, 2.0, 1.0), pose=Placement(x=0.25))


def greatest_mean(trace: Trace, rate: float, window: float = 0.05) -> float:
    """The greatest mean force over a window, in N."""
    return float(MeanForce.of(rate, window, ()).observe(trace, trace.contacts)[1].mean.max())


@every_engine
@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("shape", [BALL, CRATE], ids=["ball", "crate"])
def test_the_impulse_of_an_impact_is_the_change_of_momentum_at_every_rate(
    engine: str, shape: str, angle: float, tmp_path: Path
) -> None:
    """Without friction, the wall takes only the part of the velocity that is normal to it.

    PyBullet pushes a crate that hits obliquely out of the wall, the faster the greater the step is: another momentum.
    """
    normal, along = (SPEED * part(math.radians(angle)) for part in (math.cos, math.sin))
    found, expected = [], []
    for rate in RATES:
        world = World(ground=Ground(friction=0), objects=(WALL.model_copy(update={"friction": 0.0}),))
        scene = scene_of(tmp_path, shape, at(), world, rate=rate)
        trace = travelled(engine, scene, rate, start=((normal, along, 0),), contacts=True)
        found.append(greatest_mean(trace, rate) * 0.05)
        expected.append(MASS * (normal - float(trace.base_linear_xyz[-1, 0])))
        assert normal * MASS * 0.95 <= expected[-1] <= normal * MASS * 1.6
    assert found == pytest.approx(expected, rel=0.02)
    if shape is BALL or angle == 0.0:
        assert max(found) <= 1.1 * min(found)


@every_engine
@pytest.mark.parametrize("rate", RATES)
def test_the_mean_force_on_a_scale_is_the_weight(engine: str, rate: int, tmp_path: Path) -> None:
    world = World(objects=(Body(name="scale", box=(1.0, 1.0, 0.1)),))
    with running(engine, scene_of(tmp_path, CRATE, at(z=0.2), world, rate=rate), contacts=True) as backend:
        advance(backend, -rate, rate)
        start = backend.observe(0, contacts=True)
        trace = advance(backend, 0, rate // 4)
    for window in (1 / rate, 0.05, 0.1):
        _, mean = MeanForce.of(rate, window, start.contacts).observe(trace, trace.contacts)[1]
        assert mean == pytest.approx(np.full(rate // 4, MASS * GRAVITY), rel=0.01)


BUMP = """\
name: bump
backend: ENGINE
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 1, 0.5], pose: {x: 0.5}}]}
physics: {rate: RATE Hz}
commands: {twist: [{linear: 0.2}], rate: 10 Hz}
expect:
  - contact: {with: wall, at_most: 40 N}
  - contact: {with: wall, impulse: {at_most: 1.5 N s}, window: 100 ms}
  - contact: {with: wall, at_least: 5 N, at_most: 20 N}
  - {contact: {with: wall, at_most: 5 N}, severity: warning}
  - {contact: {with: wall, impulse: {at_most: 0.3 N s}}, severity: warning}
  - {contact: {with: wall, at_least: 40 N}, severity: warning}
duration: 3 s
time_limit: 3 s
"""


@every_engine
def test_verdicts_on_a_bump_are_the_same_at_every_rate(engine: str, tmp_path: Path) -> None:
    runs = [simulated(tmp_path, BUMP.replace("ENGINE", engine).replace("RATE", str(rate))) for rate in RATES]
    verdicts = {tuple(verdict.passed for verdict in run.verdicts) for run in runs}
    assert verdicts == {(True, True, True, False, False, False)}


def test_a_stored_trace_at_10_hz_has_the_verdicts_of_the_run(tmp_path: Path) -> None:
    loaded = load(tmp_path, BUMP.replace("ENGINE", installed()[0]).replace("RATE", "240") + "trace: {rate: 10 Hz}\n")
    scene = build_scene(loaded)
    run = simulate(loaded.scenario, scene, lambda _: None)
    assert len(run.trace) < 40
    for expected, verdict in zip(loaded.scenario.expect, run.verdicts, strict=True):
        assert isinstance(expected.assertion, Touch)
        stored = expected.assertion.monitor(scene, START).observe(run.trace).verdict()
        assert (stored.measured, stored.margin, stored.message) == (verdict.measured, verdict.margin, verdict.message)
