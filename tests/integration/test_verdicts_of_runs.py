"""A pass means that something was checked: properties of verdicts of random scenarios, simulated by an engine."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from tests.simulated import simulated
from tests.soak import examples

DURATION_S: Final = 0.75
FAR: Final = 40.0


class Limited(NamedTuple):
    """An invariant with an upper (`least`: lower) limit, and the goal to exceed it, if there is one."""

    of: Callable[[float], dict[str, Any]]
    goal: Callable[[float], dict[str, Any]] | None = None
    least: bool = False
    loose: float = FAR


def scan(key: str, which: str, **more: Any) -> Callable[[float], dict[str, Any]]:
    return lambda value: {"sensor": {"name": "scan", "reading": "ranges", "which": which, key: value, **more}}


LIMITS: Final[Mapping[str, Limited]] = {
    "travel": Limited(lambda m: {"travel": {"at_most": m}}, lambda m: {"travel": {"at_least": m}}),
    "path": Limited(lambda m: {"path_length": {"at_most": m}}, lambda m: {"path_length": {"at_least": m}}),
    "speed": Limited(lambda v: {"max_speed": {"linear": v}}),
    "tilt": Limited(
        lambda a: {"upright": {"max_tilt": f"{a} rad"}},
        lambda a: {"not": {"upright": {"max_tilt": f"{a} rad"}}},
        loose=2.0,
    ),
    "wheel": Limited(
        lambda a: {"joint": {"name": "wheel_left_joint", "at_most": a}},
        lambda a: {"joint": {"name": "wheel_left_joint", "at_least": a}},
        loose=500.0,
    ),
    "clearance": Limited(
        lambda m: {"clearance": {"at_least": m}}, lambda m: {"clearance": {"at_most": m}}, least=True, loose=1e-6
    ),
    "range": Limited(scan("at_least", "min"), scan("at_most", "min", once=True), least=True, loose=0.0),
    "stl": Limited(
        lambda v: {"stl": f"always turn_rate < {v:.12f} rad/s"},
        lambda v: {"stl": f"eventually turn_rate > {v:.12f} rad/s"},
    ),
    "energy": Limited(lambda j: {"energy": {"at_most": j}}),
    "effort": Limited(lambda n: {"effort": {"at_most": n}}),
}


def ran(
    folder: Path, engine: str, drive: Sequence[Mapping[str, Any]], expected: Sequence[Mapping[str, Any]], limit: float
) -> SimulationRun:
    scenario = {
        "name": "random",
        "robot": {"model": "turtlebot3_burger"},
        "world": {"objects": [{"name": "wall", "box": [0.1, 4, 0.5], "pose": {"x": 1.5}}]},
        "sensors": [{"lidar": {"rays": 4, "range": "10 m"}, "name": "scan", "link": "base_scan", "rate": "20 Hz"}],
        "commands": {"twist": drive},
        # A warning does not end the run, so each expectation sees all of it.
        "expect": [{**one, "severity": "warning"} for one in expected],
        "allow": ["warnings-only", "unreachable-limit"],
        "duration": limit,
        "time_limit": limit,
        "backend": engine,
    }
    return simulated(folder, scenario)


speeds = st.floats(-0.6, 0.6).map(lambda value: round(value, 3))
drives = st.lists(
    st.fixed_dictionaries({"linear": speeds, "angular": speeds, "for": st.sampled_from([0.2, 0.4])}),
    min_size=1,
    max_size=3,
)


@pytest.mark.parametrize("engine", installed())
@examples(2)
@given(drives, st.sampled_from([0.0, 0.25]))
def test_verdicts_of_random_drives(engine: str, drive: list[dict[str, Any]], after: float) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        loose = ran(
            folder, engine, drive, [{**one.of(one.loose), "after": after} for one in LIMITS.values()], DURATION_S
        )
        tight: list[dict[str, Any]] = []
        goals: list[dict[str, Any]] = []
        for limited, verdict in zip(LIMITS.values(), loose.verdicts, strict=True):
            assert verdict.passed, verdict.message
            assert verdict.judged
            assert verdict.judged.moments > 0
            assert verdict.judged.first is not None
            assert after - 1e-9 <= verdict.judged.first <= loose.sim_time
            assert verdict.measured is not None
            margin = 1e-6 * max(1.0, abs(verdict.measured))
            inside, outside = verdict.measured - margin, verdict.measured + margin
            if limited.least:
                inside, outside = outside, inside
            if inside > 0:
                tight.append({**limited.of(inside), "after": after})
            if limited.goal is not None:
                goals.append({**limited.goal(outside), "after": after})
        assert len(tight) >= len(LIMITS) / 2
        for limit in (DURATION_S, 1.5 * DURATION_S):
            broken = ran(folder, engine, drive, tight, limit)
            assert [verdict.status for verdict in broken.verdicts] == ["failed"] * len(tight)
        missed = ran(folder, engine, drive, goals, DURATION_S)
        assert missed.digest == loose.digest
        assert not any(verdict.passed for verdict in missed.verdicts), [one.message for one in missed.verdicts]
