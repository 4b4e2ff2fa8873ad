"""A scenario's own arithmetic: steps, rates, limits."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from pydantic import ValidationError

from sim_action.assertions.distance import Travel
from sim_action.commands.script import ScriptCommands
from sim_action.commands.twist import TwistCommands, TwistSegment
from sim_action.core.errors import InvalidPart
from sim_action.core.units import rate_divides
from sim_action.core.yaml_document import Document
from sim_action.scenario.model import LoadedScenario, Scenario, common_rate
from sim_action.scenario.source import Source
from tests.traces import HERE, expectation, scenario

DRIVES = TwistCommands(twist=(TwistSegment(linear=1.0),), rate=20.0)
SIMPLE = scenario(expectation(Travel(at_least=1.0)))


def changed(**fields: object) -> Scenario:
    return SIMPLE.model_copy(update=fields)


@pytest.mark.parametrize(
    ("physics", "rate", "divides"),
    [
        (240, 10, True),
        (240, 240, True),
        (240, 7, False),
        (240, 480, False),
        (240, 0.5, True),
        (1000, 1000 / 3, True),
        (240, 1e-323, False),
        (240, 159.99, False),
    ],
)
def test_a_rate_divides_if_its_ticks_fall_on_steps(physics: float, rate: float, divides: bool) -> None:
    assert rate_divides(physics, rate) is divides


@pytest.mark.parametrize(
    ("rates", "common"),
    [
        ([], 240),
        ([10, 40], 240),
        ([50], 250),
        ([30, 50], 300),
        ([100, 40], 400),
        ([70], 280),
        ([62.5], 250),
        ([1000], 1000),
        ([1000, 240], None),
        ([2000], None),
        ([1e-300], None),
        ([500, 400], None),
    ],
)
def test_the_rate_of_the_physics_is_the_least_from_240_that_all_rates_divide(
    rates: list[float], common: float | None
) -> None:
    assert common_rate(rates, 240.0, 1000.0) == common


@pytest.mark.parametrize(
    ("seconds", "step"), [(0, 0), (1 / 240, 1), (0.1, 24), (0.7, 168), (0.33, 80), (10, 2400), (0.1 + 0.2, 72)]
)
def test_the_first_step_at_or_after_a_time(seconds: float, step: int) -> None:
    assert SIMPLE.steps(seconds) == step


@pytest.mark.parametrize(("limit", "wall"), [(1.0, 60.0), (6.0, 60.0), (30.0, 300.0)])
def test_the_wall_limit_is_ten_times_the_time_limit_but_a_minute_at_least(limit: float, wall: float) -> None:
    assert changed(time_limit=limit).wall_seconds == wall
    assert changed(time_limit=limit, wall_limit=5.0).wall_seconds == 5.0


@pytest.mark.parametrize(
    ("key", "written", "size"),
    [
        ("memory_limit", "512 MiB", 1 << 29),
        ("memory_limit", "1.5 GiB", 3 << 29),
        ("memory_limit", 8e9, 8_000_000_000),
        ("output_limit", "2 kB", 2000),
        ("output_limit", "1 B", 1),
    ],
)
def test_limits_are_amounts_of_data(key: str, written: object, size: int) -> None:
    assert (SIMPLE.memory_bytes, SIMPLE.output_bytes) == (4 << 30, 100_000_000)
    read = Scenario.model_validate({**dict(SIMPLE), key: written})
    assert {"memory_limit": read.memory_bytes, "output_limit": read.output_bytes}[key] == size


@pytest.mark.parametrize(
    ("key", "written"),
    [
        ("memory_limit", "511 MiB"),
        ("memory_limit", "2e9 GiB"),
        ("memory_limit", "4 Gb"),
        ("output_limit", 0),
        ("output_limit", "1 s"),
    ],
)
def test_limits_that_nothing_could_run_in_are_refused(key: str, written: object) -> None:
    with pytest.raises(ValidationError, match=key):
        Scenario.model_validate({**dict(SIMPLE), key: written})


def test_the_trace_is_kept_at_the_fastest_rate_of_a_command() -> None:
    assert SIMPLE.trace_rate == 10.0
    assert changed(commands=(DRIVES, ScriptCommands(script="a.py", rate=5.0))).trace_rate == 20.0
    # A script is code of the users.
    assert not changed(commands=(DRIVES,)).runs_user_code
    assert changed(commands=(DRIVES, ScriptCommands(script="a.py"))).runs_user_code


def test_what_is_no_scenario() -> None:
    with pytest.raises(InvalidPart, match="must not be empty"):
        scenario()
    for limit in (0.0, -1.0, 86_401.0):  # seconds: above 0, and at most a day
        with pytest.raises(InvalidPart):
            scenario(expectation(Travel(at_least=1.0)), time_limit=limit)


def test_a_loaded_scenario_goes_to_its_child_as_a_pickle() -> None:
    source = Source(Path("s.sim.yml"), HERE, Document("s.sim.yml", {}), "s")
    loaded = LoadedScenario(changed(commands=(DRIVES,)), source)
    assert loaded.file == "s.sim.yml"
    assert pickle.loads(pickle.dumps(loaded)) == loaded
