"""Phrases that several reports share."""

from __future__ import annotations

from typing import Literal

from sim_action import units
from sim_action.outcome import Outcome, Results
from sim_action.verdict import Verdict

Mood = Literal["passed", "warned", "failed", "error"]
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
    )
    return (", ".join(f"{count} {name}" for count, name in named if count) or "no scenario") + warned


def speed(sim_time: float | None, wall_time: float) -> str:
    """Such as "12x real time"; empty if nothing was simulated."""
    return factor(sim_time / wall_time) if sim_time and wall_time > 0 else ""


def factor(real_time_factor: float | None) -> str:
    """A real-time factor in words; empty if there is none."""
    if real_time_factor is None:
        return ""
    return f"{real_time_factor:.0f}x real time" if real_time_factor >= 10 else f"{real_time_factor:.1f}x real time"


def overall_speed(results: Results) -> str:
    """Of everything that was simulated, in the time that it all took."""
    return speed(sum(outcome.sim_time or 0.0 for outcome in results.outcomes), results.wall_time)


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
