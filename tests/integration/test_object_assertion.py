"""Claims on bodies of the world on every engine: they barely hold and barely fail where formulas say so."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.simulated import simulated

GRAVITY = 9.80665
RATE = 240
# The crate rises by 20 cm, tips by 30 deg and moves 40 cm along x from 0.25 s to 0.5 s, and then stands.
CRATE = {
    "name": "crate",
    "box": [0.1, 0.1, 0.1],
    "pose": {"x": -1.0, "z": 0.5},
    "path": [{"at": 0.25, "x": -1.0, "z": 0.5}, {"at": 0.5, "x": -0.6, "z": 0.7, "roll": "30 deg"}],
}
BALL = {"name": "ball", "sphere": {"radius": 0.1}, "mass": 0.1, "pose": {"x": 1.0, "y": 2.0, "z": 2.0}}
PARCEL = {"name": "parcel", "box": [0.1, 0.1, 0.1], "mass": 1, "pose": {"x": -2, "z": 2}, "appears": 0.25}
END = 0.75


def run(folder: Path, engine: str, *asked: dict[str, Any], **keys: Any) -> SimulationRun:
    scenario = {
        "name": "objects move",
        "robot": {"model": "turtlebot3_burger"},
        "physics": {"settle": 0},
        "world": {"objects": [CRATE, BALL, PARCEL]},
        "expect": [{"object": one, "severity": "warning"} for one in asked],
        "allow": ["warnings-only"],
        "duration": END,
        "time_limit": END,
        "trace": {"rate": RATE},
        "backend": engine,
        **keys,
    }
    return simulated(folder, scenario)


def fallen(steps: Any) -> Any:
    """The height that a body has lost after these steps: both engines integrate semi-implicitly."""
    return GRAVITY / RATE**2 * steps * (steps + 1) / 2


@on_every_engine
def test_bodies_have_a_pose_at_every_step_of_the_trace_which_changes_nothing(engine: str, tmp_path: Path) -> None:
    wall = {"name": "wall", "box": [0.1, 2.0, 0.5], "pose": {"x": 3}}
    keys = {"world": {"objects": [CRATE, BALL, PARCEL, wall]}, "commands": {"twist": [{"linear": 0.2}]}}
    names = ("crate", "ball", "parcel", "wall")
    seen = [{"stl": f"always distance(base_scan, {name}) < 99 m", "severity": "warning"} for name in names]
    full, thinned = (run(tmp_path, engine, **keys, expect=seen, trace={"rate": rate}) for rate in (RATE, RATE / 10))
    plain = run(tmp_path, engine, **keys, expect=["upright"], allow=[])
    assert full.digest == plain.digest
    assert plain.trace.objects == {}
    trace, steps = full.trace, np.arange(round(END * RATE) + 1)
    assert all((record.time == trace.time).all() for record in trace.objects.values())
    crate, ball, parcel, stands = (trace.objects[name].position_xyz for name in names)
    assert crate[:, 2] == pytest.approx(0.5 + 0.2 * np.clip((trace.time - 0.25) / 0.25, 0, 1), abs=1e-6)
    # The ball meets the ground after 0.62 s.
    assert ball[:140, 2] == pytest.approx(2.0 - fallen(steps[:140]), abs=1e-6)
    assert (np.isnan(parcel).all(axis=1) == (steps < 60)).all()
    assert parcel[60:, 2] == pytest.approx(2.0 - fallen(steps[:-60]), abs=1e-6)
    assert stands == pytest.approx(np.tile([3.0, 0.0, 0.25], (len(steps), 1)))
    assert len(thinned.trace) == 19
    for name, record in thinned.trace.objects.items():
        assert (record.time == thinned.trace.time).all()
        every = trace.objects[name].rows(np.searchsorted(trace.time, record.time))
        np.testing.assert_array_equal(record.position_xyz, every.position_xyz)
        np.testing.assert_array_equal(record.orientation_xyzw, every.orientation_xyzw)


@on_every_engine
def test_limits_on_a_body_on_a_path(engine: str, tmp_path: Path) -> None:
    way, eps = math.hypot(0.4, 0.2), 1e-4
    pairs: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"moved": {"up": 0.2 - eps}}, {"moved": {"up": 0.2 + eps}}),
        ({"moved": {"at_least": way - eps}}, {"moved": {"at_least": way + eps}}),
        ({"moved": {"at_most": way + eps}}, {"moved": {"at_most": way - eps}}),
        ({"upright": {"max_tilt": "30.01 deg"}}, {"upright": {"max_tilt": "29.99 deg"}}),
        ({"stay_within": {"z": [0.4, 0.7 + eps]}}, {"stay_within": {"z": [0.4, 0.7 - eps]}}),
        (
            {"reach": {"x": -0.5, "y": 0, "z": 0.7, "tolerance": 0.1 + eps}},
            {"reach": {"x": -0.5, "y": 0, "z": 0.7, "tolerance": 0.1 - eps}},
        ),
        # It is at rest from one step after its arrival on.
        ({"settled": {"for": END - 0.5 - 1.5 / RATE}}, {"settled": {"for": END - 0.5 + 0.5 / RATE}}),
    ]
    asked = [{"name": "crate", **one} for pair in pairs for one in pair]
    verdicts = run(tmp_path, engine, *asked).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, False] * len(pairs)


@on_every_engine
def test_limits_on_bodies_that_fall(engine: str, tmp_path: Path) -> None:
    # The parcel appears at 0.25 s and falls until the end.
    there = round((END - 0.25) * RATE)
    way = fallen(there)
    asked = [
        {"name": "parcel", "moved": {"at_least": way - 1e-5}},
        {"name": "parcel", "moved": {"at_least": way + 1e-5}},
        {"name": "parcel", "stay_within": {"z": [2 - way - 1e-5, 2.001]}},
        {"name": "parcel", "stay_within": {"z": [2 - way + 1e-5, 2.001]}},
    ]
    found = run(tmp_path, engine, *asked)
    assert [verdict.passed for verdict in found.verdicts] == [True, False, True, False]
    assert [verdict.judged.moments for verdict in found.verdicts if verdict.judged] == [there + 1] * 4


@on_every_engine
def test_a_run_goes_on_after_a_body_has_appeared(engine: str, tmp_path: Path) -> None:
    """It has appeared, and is judged: both say so."""
    found = run(tmp_path, engine, {"name": "parcel", "upright": {}}, duration=0.1, allow=["warnings-only"])
    (verdict,) = found.verdicts
    assert (verdict.passed, verdict.judged and verdict.judged.moments) == (True, 2)
    assert found.sim_time == pytest.approx(0.25 + 1 / RATE)
    assert not any("never appeared" in each for each in (*found.notes, *map(str, found.findings)))


@on_every_engine
def test_a_body_that_never_appeared_was_not_judged(engine: str, tmp_path: Path) -> None:
    asked = [{"object": {"name": "parcel", "upright": {}}}, {"object": {"name": "ball", "moved": {"at_most": 0.01}}}]
    parcel, ball = run(tmp_path, engine, expect=asked, allow=[]).verdicts
    assert (parcel.status, ball.status) == ("not_exercised", "failed")
    assert "never appeared: it is due at 0.25 s, but the run ended at 0.0" in parcel.message


@on_every_engine
def test_a_link_of_the_robot_sees_a_body(engine: str, tmp_path: Path) -> None:
    drive = {"twist": [{"linear": 0.2, "angular": 1.0}]}
    frames = {"physics": {"settle": 1}, "commands": drive}
    loose = run(tmp_path, engine, {"name": "crate", "moved": {"at_most": 100, "frame": "base_scan"}}, **frames)
    trace, crate = loose.trace, loose.trace.objects["crate"].position_xyz
    # The scanner stands at (-0.064, 0, 0.122 + 0.01) in the base's frame, and its axes are those of the base.
    turn = -trace.yaw
    along, across = (crate - trace.base_position_xyz)[:, :2].T
    seen = np.column_stack((np.cos(turn) * along - np.sin(turn) * across, np.sin(turn) * along + np.cos(turn) * across))
    farthest = float(np.sqrt(((seen - seen[0]) ** 2).sum(axis=1) + (crate[:, 2] - crate[0, 2]) ** 2).max())
    assert loose.verdicts[0].measured == pytest.approx(farthest, abs=2e-3)
    limits = [{"name": "crate", "moved": {"at_most": farthest + more, "frame": "base_scan"}} for more in (3e-3, -3e-3)]
    assert [verdict.passed for verdict in run(tmp_path, engine, *limits, **frames).verdicts] == [True, False]
