"""Phrases that several reports share."""

from __future__ import annotations

from typing import Literal

from sim_action.core import units
from sim_action.core.provenance import Provenance
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.results.shards import Shard
from sim_action.state.verdict import Verdict

DisplayStatus = Literal["passed", "warned", "failed", "flaky", "error", "skipped"]
"""A status, with passing and warning told apart."""


def display_status(outcome: Outcome) -> DisplayStatus:
    """How a scenario is to be looked at."""
    if outcome.status != "passed":
        return outcome.status
    return "warned" if any(expected.warned for expected in outcome.expectations) else "passed"


def user_output(outcome: Outcome) -> str:
    """What the user's code printed, unless that is told already as the last words."""
    told = any(failure.details == outcome.output for failure in outcome.failures)
    return "" if told else outcome.output.strip("\n")


def counts_text(results: Results) -> str:
    """Such as "3 passed, 1 failed, 2 warnings"; a warning is an expectation, the others are scenarios."""
    warnings = sum(expected.warned for outcome in results.outcomes for expected in outcome.expectations)
    warned = f", {warnings} {'warning' if warnings == 1 else 'warnings'}" if warnings else ""
    errors = results.count("error")
    named = (
        (results.count("passed"), "passed"),
        (results.count("failed"), "failed"),
        (results.count("flaky"), "flaky"),
        (errors, "error" if errors == 1 else "errors"),
        (results.count("skipped"), "not run"),
    )
    return (", ".join(f"{count} {name}" for count, name in named if count) or "no scenario") + warned


def repeats_text(outcome: Outcome) -> str:
    """Such as "the same 5 times"; empty if it was run once."""
    repeats = outcome.repeats
    if repeats is None:
        return ""
    if repeats.agreed == 1:
        return f"no two of {repeats.count} runs the same"
    same = repeats.agreed == repeats.count
    return f"the same {repeats.count} times" if same else f"the same in {repeats.agreed} of {repeats.count} runs"


def provenance_rows(provenance: Provenance | None) -> dict[str, str]:
    """What a run was made with, a line each."""
    if provenance is None:
        return {}
    numpy = f", numpy {provenance.numpy}" if provenance.numpy else ""
    versions = f"sim-action {provenance.sim_action}, Python {provenance.python}{numpy}"
    build = {"build": provenance.engine_build} if provenance.engine_build else {}
    return {**build, "cpu": provenance.cpu, "made by": versions, "system": provenance.platform}


def shard_text(shard: Shard) -> str:
    """Such as "shard 1 of 3 (5 scenarios in all)"."""
    return f"{shard} ({shard.total} {'scenario' if shard.total == 1 else 'scenarios'} in all)"


def speed_text(real_time_factor: float | None) -> str:
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
