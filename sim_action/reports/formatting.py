"""Texts that several reports share: status, counts, quantities, times, speed, provenance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from sim_action.core import units
from sim_action.core.errors import ExitCode
from sim_action.core.provenance import Provenance
from sim_action.core.wording import counted, shortened
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.results.outcome import ExpectationOutcome, Measurement, Outcome, Spread, Status
from sim_action.results.results_json import Results, Shard
from sim_action.state.timeline import TimeMark
from sim_action.state.verdict import Verdict

_COUNTED: Final[tuple[Status, ...]] = ("passed", "failed", "flaky", "inconclusive", "not_exercised", "error", "skipped")
"""All statuses of a scenario, in the order of the counts."""


_BAR: Final = 20


def measured_text(measurement: Measurement) -> tuple[str, str]:
    """Return the bar of a measurement, as of a tornado chart, and its message; the bar is empty if there is none."""
    if measurement.left is None:
        return "", measurement.message
    below, above = (
        "·" * _BAR if left is None else "█" * round(_BAR * left) + "░" * (_BAR - round(_BAR * left))
        for left in measurement.left
    )
    return f"{below[::-1]}│{above}", measurement.message


def user_output(outcome: Outcome) -> str:
    """Return the output of the user's code; empty if a failure shows the same text as its details."""
    is_shown = any(failure.details == outcome.output for failure in outcome.failures)
    return "" if is_shown else outcome.output.strip("\n")


def first_message(outcome: Outcome, most: int) -> str:
    """Return the message of the first reason why an outcome is no pass, on one line; empty if it passed."""
    messages = [failure.message for failure in outcome.failures]
    messages += [expected.verdict.message for expected in outcome.not_passed]
    return shortened(one_line(messages[0]), most) if messages else ""


def first_reason(outcome: Outcome) -> str:
    """Return the first reason why an outcome is no pass, with its title or name; empty if it passed."""
    reasons = [f"{failure.title}: {failure.message}" for failure in outcome.failures]
    reasons += [f"{expected.name}: {expected.verdict.message}" for expected in outcome.causes]
    return reasons[0] if reasons else ""


def taken_over_text(taken_over: int, results: Results) -> str:
    """Return how many outcomes come from an earlier call, such as "212 of 300 scenarios taken over ..."."""
    what = "run" if any(outcome.is_sample for outcome in results.outcomes) else "scenario"
    return f"{taken_over} of {counted(len(results.runs), what)} taken over from the earlier run"


def run_headline(results: Results) -> tuple[str, str]:
    """Return the emoji and the words of a headline, such as "2 of 5 scenarios did not pass"."""
    total, passed, left = results.total, results.count("passed"), results.count("skipped")
    gates = sum(outcome.statistics is not None for outcome in results.verdicts)
    one = "gate" if gates else "scenario"
    several = "scenarios" if not gates else "gates" if gates == total else "scenarios and gates"
    if not total:
        good = results.exit_code is ExitCode.PASSED
        if results.outcomes:
            runs = f"No verdicts here: {counted(len(results.outcomes), 'run')} for sim-action merge"
            return (INFORMATION.icon, runs) if good else ("❌", f"{runs}, and not all of them could run")
        return ("✅", f"No scenarios for {results.shard or 'this part'}") if good else ("⚠️", "No scenarios were run")
    if results.conclusion == "cancelled":
        return "🛑", f"Interrupted: {passed} of {total} {several} had passed"
    bad = total - passed - left
    icon, ending = ("❌", "did not pass") if bad or left else ("✅", "passed")
    if total == 1 and not left:
        return icon, f"The {one} {ending}"
    start = f"{bad} of {total}" if bad or left else f"All {total}"
    return icon, f"{start} {several} {ending}{f', and {left} were not run' if left else ''}"


def counts_text(results: Results) -> str:
    """Return counts as "3 passed, 1 failed, 2 warnings": of scenarios and gates, with warnings once for a gate."""
    warnings = sum(1 for _ in _warnings(results))
    warned = f", {counted(warnings, 'warning')}" if warnings else ""
    parts = [STATUS_DISPLAYS[status].counted(count) for status in _COUNTED if (count := results.count(status))]
    nothing = "no verdicts here" if results.outcomes else "no scenarios"
    return "; ".join(((", ".join(parts) or nothing) + warned, *_runs_of_gates(results), *_repetitions(results)))


def _warnings(results: Results) -> Iterator[object]:
    """Yield a key of each warning; a warning counts once for all runs of a gate."""
    for outcome in results.verdicts:
        yield from outcome.warnings
        yield from (expected for expected in outcome.expectations if expected.warned)
    samples = [outcome for outcome in results.outcomes if outcome.is_sample]
    keys = [((run.file, run.gate), warning.rule, warning.location) for run in samples for warning in run.warnings]
    soft = ((run, expected) for run in samples for expected in run.expectations if expected.warned)
    keys += [((run.file, run.gate), expected.name, expected.location) for run, expected in soft]
    yield from dict.fromkeys(keys)


def _runs_of_gates(results: Results) -> Iterator[str]:
    """Yield the numbers of runs that gates judge here, and of runs that `merge` judges together with others."""
    judged = {(outcome.file, outcome.gate) for outcome in results.outcomes if outcome.statistics is not None}
    samples = [outcome for outcome in results.outcomes if outcome.is_sample and outcome.status != "skipped"]
    judged_runs = [(run.file, run.gate) for run in samples if (run.file, run.gate) in judged]
    if judged_runs:
        yield f"{counted(len(judged_runs), 'run')} of {counted(len(set(judged_runs)), 'gate')}"
    left = [run for run in samples if (run.file, run.gate) not in judged]
    if left:
        gates = len({(run.file, run.gate) for run in left})
        stopped = sum(run.exit_code > ExitCode.FAILED for run in left)
        without = f" ({stopped} could not run)" if stopped else ""
        yield f"{counted(len(left), 'run')} of {counted(gates, 'gate')} for sim-action merge{without}"


_SAME: Final = 1e-6  # bounds that differ by less than this share of them are shown as one value


def _repetitions(results: Results) -> Iterator[str]:
    times = [repetition.wall_time for outcome in results.outcomes for repetition in outcome.repetitions]
    if times:
        yield f"{counted(len(times), 'repetition')} ({sum(times):.1f} s)"


def confidence_text(expected: ExpectationOutcome) -> str:
    """Return the interval of the margin that leaves most open, such as "margin 1 mm to 3 mm (half the step)"; or ""."""
    spreads = [spread for spread in expected.spreads if spread.low is not None]
    wide = max(spreads, key=_openness, default=None)
    return "" if wide is None else f"margin {_bounds(wide)} ({wide.cause})"


def _openness(spread: Spread) -> tuple[bool, float]:
    low, high = spread.low or 0.0, spread.high or 0.0
    return not spread.is_decided, (high - low) / (abs(high + low) or 1.0)


def spread_texts(expected: ExpectationOutcome) -> list[str]:
    """Return one text for each repetition, such as "half the step: measured 1 m, margin 1 mm to 3 mm"."""
    return [f"{spread.cause}: {', '.join(_of_spread(spread))}" for spread in expected.spreads]


def _of_spread(spread: Spread) -> Iterator[str]:
    yield "no verdict" if spread.status is None else spread.status.replace("_", " ")
    if spread.measured is not None:
        yield f"measured {quantity(spread.measured, spread.unit)}"
    if spread.low is not None:
        yield f"margin {_bounds(spread)}"
    if spread.note:
        yield spread.note


def _bounds(spread: Spread) -> str:
    bounds = spread.low or 0.0, spread.high or 0.0
    if math.isclose(*bounds, rel_tol=_SAME):
        return units.display(bounds[0], spread.unit)
    return " to ".join(units.display_apart(*bounds, spread.unit))


def repeats_text(outcome: Outcome) -> str:
    """Return a text such as "4 of 5 runs identical"; empty if the scenario ran once."""
    repeats = outcome.repeats
    if repeats is None:
        return ""
    if repeats.agreed == 1:
        return f"{repeats.count} runs, all different"
    same = repeats.agreed == repeats.count
    return f"{repeats.count} identical runs" if same else f"{repeats.agreed} of {repeats.count} runs identical"


def provenance_rows(provenance: Provenance | None) -> dict[str, str]:
    """Return label -> value for the versions and the machine of a run."""
    if provenance is None:
        return {}
    numpy = f", numpy {provenance.numpy}" if provenance.numpy else ""
    packages = "".join(f", {package}" for package in provenance.packages)
    versions = f"sim-action {provenance.sim_action}, Python {provenance.python}{numpy}{packages}"
    build = {"build": provenance.engine_build} if provenance.engine_build else {}
    return {**build, "cpu": provenance.cpu, "versions": versions, "system": provenance.platform}


def run_facts(outcome: Outcome, results: Results | None = None) -> dict[str, str]:
    """Return label -> value of the details of a run, without empty ones; `results`: the call that it belongs to."""
    runs = f", {outcome.repeats.count} runs" if outcome.repeats else ""
    versions = "" if results is None else f"sim-action {results.sim_action}, Python {results.python}"
    facts = {
        "variation": ", ".join(f"{varied.key} = {varied.value}" for varied in outcome.variation),
        "ended by": outcome.end or "",
        "sim time": quantity(outcome.sim_time, "s"),
        "speed": speed_text(outcome.real_time_factor),
        # It covers more than the simulation loop, to which the speed refers.
        "wall time": f"{quantity(outcome.wall_time, 's')} (with start-up{runs})" if outcome.wall_time else "",
        "travelled": quantity(outcome.travelled, "m"),
        "engine": outcome.engine or "",
        "seed": "" if outcome.seed is None else str(outcome.seed),
        "digest": outcome.digest or "",
        "repeated": repeats_text(outcome),
        "repetitions": "; ".join(f"{repetition.cause}: {repetition.ending}" for repetition in outcome.repetitions),
        **(provenance_rows(outcome.provenance) or {"versions": versions}),
        "trace": outcome.trace or "",
        "recordings": ", ".join(outcome.recordings),
    }
    return {name: value for name, value in facts.items() if value}


def shard_text(shard: Shard) -> str:
    """Return a text such as "shard 1 of 3 (5 runs in total)"; a scenario without variations is one run."""
    return f"{shard} ({counted(shard.total, 'run')} in total)"


def speed_text(real_time_factor: float | None) -> str:
    """Return a real-time factor as text, such as "12x real time"; empty for None."""
    if real_time_factor is None:
        return ""
    return f"{real_time_factor:.0f}x real time" if real_time_factor >= 10 else f"{real_time_factor:.1f}x real time"


def took_text(results: Results, taken_over: int | None = None) -> str:
    """Return the wall time of a call and its speed, such as "1.2 s (12x real time)"."""
    # The simulations of the earlier call took time, too.
    factor = None if taken_over else results.real_time_factor
    return f"{results.wall_time:.1f} s" + (f" ({speed_text(factor)})" if factor else "")


def simulated_text(outcome: Outcome) -> str:
    """Return the simulated time of a run, such as "2.00 s simulated"; empty without any."""
    return "" if outcome.sim_time is None else f"{moment(outcome.sim_time)} simulated"


def quantity(value: float | None, unit: str) -> str:
    """Return a value with its unit for people; empty for None."""
    return "" if value is None else units.display(value, unit)


def moment(time: float | None) -> str:
    """Return a sim time in s for people, such as "1.20 s"; empty for None."""
    return "" if time is None else f"{time:.2f} s"


def measurements(verdict: Verdict) -> str:
    """Return the numbers of a verdict, such as "measured 1.12 m, limit 1.5 m, margin -0.38 m, at 30.00 s"."""
    named = {"measured": verdict.measured, "limit": verdict.limit, "margin": verdict.margin}
    parts = [f"{name} {units.display(value, verdict.unit)}" for name, value in named.items() if value is not None]
    return ", ".join(parts if verdict.time is None else [*parts, f"at {moment(verdict.time)}"])


def judged_text(verdict: Verdict) -> str:
    """Return when a verdict was judged, as "judged at 240 moments, 0.00 s to 1.00 s"; empty if not counted."""
    judged = verdict.judged
    if judged is None:
        return ""
    if judged.moments <= 0 or judged.first is None or judged.last is None:
        return "judged at no moment"
    several = f"{moment(judged.first)} to {moment(judged.last)}" if judged.moments > 1 else moment(judged.first)
    return f"judged at {counted(judged.moments, 'moment')}, {several}"


_MAX_MARKS: Final = 6


def timeline(outcome: Outcome) -> tuple[TimeMark, ...]:
    """Return the last marks of a run that did not pass, planned commands only where there is room; of others none."""
    if outcome.status in ("passed", "skipped"):
        return ()
    chosen = sorted(outcome.marks, key=lambda mark: (mark.is_planned, -mark.time))[:_MAX_MARKS]
    return tuple(mark for mark in outcome.marks if mark in chosen)


def timeline_text(outcome: Outcome) -> str:
    """Return the timeline on one line; empty if nothing happened."""
    return "; ".join(mark.title for mark in timeline(outcome))
