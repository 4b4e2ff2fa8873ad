"""Phrases that several reports share."""

from __future__ import annotations

from typing import Literal

from sim_action import units
from sim_action.outcome import Outcome, Results
from sim_action.sharding import Shard
from sim_action.verdict import Verdict

Mood = Literal["passed", "warned", "failed", "error", "skipped"]
"""A status, with passing and warning told apart."""


def mood(outcome: Outcome) -> Mood:
    """How a scenario is to be looked at."""
    if outcome.status != "passed":
        return outcome.status
    return "warned" if any(expected.warned for expected in outcome.expectations) else "passed"


def own_output(outcome: Outcome) -> str:
    """What the user's code printed, unless that is told already as the last words."""
    told = any(failure.details == outcome.output for failure in outcome.failures)
    return "" if told else outcome.output.strip("\n")


def counts(results: Results) -> str:
    """Such as "3 passed, 1 failed, 2 warnings"; a warning is an expectation, the others are scenarios."""
    warnings = sum(expected.warned for outcome in results.outcomes for expected in outcome.expectations)
    warned = f", {warnings} {'warning' if warnings == 1 else 'warnings'}" if warnings else ""
    errors = results.count("error")
    named = (
        (results.count("passed"), "passed"),
        (results.count("failed"), "failed"),
        (errors, "error" if errors == 1 else "errors"),
        (results.count("skipped"), "not run"),
    )
    return (", ".join(f"{count} {name}" for count, name in named if count) or "no scenario") + warned


def share(shard: Shard) -> str:
    """Such as "shard 1 of 3 (5 scenarios in all)"."""
    return f"{shard} ({shard.total} {'scenario' if shard.total == 1 else 'scenarios'} in all)"


def factor(real_time_factor: float | None) -> str:
    """A real-time factor in words, such as "12x real time"; empty if there is none."""
    if real_time_factor is None:
        return ""
    return f"{real_time_factor:.0f}x real time" if real_time_factor >= 10 else f"{real_time_factor:.1f}x real time"


def quantity(value: float | None, unit: str) -> str:
    """A value for people; empty if there is none."""
    return "" if value is None else units.display(value, unit)


def moment(time: float | None) -> str:
    """A sim time for people; empty if there is none."""
    return "" if time is None else f"{time:.2f} s"


def measurements(verdict: Verdict) -> str:
    """Such as "measured 1.12 m, limit 1.5 m, margin -0.38 m, at 30.00 s"; only what there is."""
    named = {"measured": verdict.measured, "limit": verdict.limit, "margin": verdict.margin}
    parts = [f"{name} {units.display(value, verdict.unit)}" for name, value in named.items() if value is not None]
    return ", ".join(parts if verdict.time is None else [*parts, f"at {moment(verdict.time)}"])
