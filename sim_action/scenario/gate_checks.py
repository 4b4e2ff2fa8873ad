"""Checks of a gate that need the whole scenario: samples that cannot differ, and limits in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from sim_action.core import units
from sim_action.core.errors import Problem
from sim_action.scenario.model import Expectation, Scenario
from sim_action.scenario.source import Source
from sim_action.scenario.variations.gate import GATE, PlannedGate, Quantile

_REMEDY: Final = (
    "draw a key in 'variations', such as world.ground.friction: {uniform: [0.4, 0.8]}, or give a sensor 'noise'"
)


def gate_problems(gate: PlannedGate, source: Source, scenario: Scenario) -> Iterator[Problem]:
    """Yield the problems of the gate of a scenario; its file may be a base of the scenario."""
    if source.differs_by_seed and not scenario.is_random:
        yield Problem(gate.location, _equal_runs(gate, source.equal_draws))
    for claim in gate.gate.quantile:
        if (text := _other_unit(claim, scenario)) is not None:
            yield Problem(gate.location, text)


def _equal_runs(gate: PlannedGate, draws: tuple[str, ...]) -> str:
    keys = " and ".join(f"'{key}'" for key in draws)
    reason = f"all samples of {keys} have one value" if keys else "nothing is drawn"
    return f"{GATE}: all {gate.runs} runs would be the same: {reason} and nothing is noisy; {_REMEDY}"


def _other_unit(claim: Quantile, scenario: Scenario) -> str | None:
    """Return the problem of a limit whose unit is not that of the measured value; None if either is not known."""
    _, stated = units.with_si_unit(claim.bound)
    named = [each for each in scenario.expect if each.name == claim.expectation]
    found = named or [each for each in scenario.expect if claim.expectation == each.assertion.key]
    if not stated or len(found) != 1 or not (possible := _units_of(found[0])) or stated in possible:
        return None
    unit = possible[0]
    return f"{GATE}.quantile: {claim.of} is in {unit}, and the limit is {claim.bound}; write it in {unit}"


def _units_of(expected: Expectation) -> tuple[str, ...]:
    unit = expected.assertion.measured_unit
    # A goal that must hold for a time, or was true from the beginning, measures this time.
    return () if unit is None else (unit, units.TIME.si) if expected.assertion.is_goal else (unit,)
