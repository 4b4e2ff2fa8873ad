"""The option `run --update-golden`: it finds the golden files of all runs, refuses shared ones, and writes them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from sim_action.assertions.matches import Matches, single_row
from sim_action.core.errors import InvalidScenario, Problem
from sim_action.core.records import replace
from sim_action.core.workspace import PathError
from sim_action.results.output_folder import is_foreign
from sim_action.scenario.model import Expectation, LoadedScenario, Scenario
from sim_action.scenario.source import Refused
from sim_action.state.golden_trajectory import Golden, GoldenError, is_golden
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world.claims import SINGLE_ROW
from sim_action.world.scene import Scene

Plan = tuple[LoadedScenario, ...] | Refused


def refuse_shared_goldens(plans: Iterable[Plan]) -> list[Plan]:
    """Return plans that record all moments; plans that share a golden file are refused, each name once."""
    checked = [_with_places(plan) for plan in plans]
    writers: dict[Path, list[str]] = defaultdict(list)
    for plan in checked:
        for run in () if isinstance(plan, Refused) else plan:
            for path, _, _ in _goldens(run):
                writers[path].append(run.scenario.name)
    planned = [_planned(plan, writers) for plan in checked]
    refused = {(plan.file, plan.name): plan for plan in reversed(planned) if isinstance(plan, Refused)}
    return [plan for plan in planned if not isinstance(plan, Refused) or refused[plan.file, plan.name] is plan]


def updated_goldens(
    loaded: LoadedScenario, scene: Scene, trace: Trace, verdicts: Sequence[Verdict]
) -> tuple[tuple[Verdict, ...], tuple[str, ...]]:
    """Write the golden files of a run that passed, and return its verdicts, and a note on each file.

    If another expectation failed or was not exercised, nothing is written, and the verdict on each file says so. With
    --force the files are written, and say so in their first line. Raise InvalidScenario.

    `trace`: the trace of every physics step. `verdicts`: one for each expectation.
    """
    goldens = [(expected, matches) for _, expected, matches in _goldens(loaded)]
    reason = next(_missed(loaded.scenario, verdicts), "")
    if not reason or loaded.workspace.forces_golden:
        written = partial(_written, scene, trace, allow=loaded.scenario.allow, reason=reason)
        return tuple(verdicts), tuple(written(expected, matches) for expected, matches in goldens)
    names = {id(expected): matches.file_in(scene) for expected, matches in goldens}
    remedy = "correct the scenario or the robot, or add --force"
    return tuple(
        replace(verdict, passed=False, message=f"{name} is not written, because {reason}; {remedy}")
        if (name := names.get(id(expected))) is not None and verdict.passed
        else verdict
        for expected, verdict in zip(loaded.scenario.expect, verdicts, strict=True)
    ), ()


def _missed(scenario: Scenario, verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield a clause for each expectation that prevents a pass."""
    for expected, verdict in zip(scenario.expect, verdicts, strict=True):
        is_accepted = verdict.status == "not_exercised" and scenario.unexercised == "warn"
        if verdict.status != "passed" and expected.severity == "error" and not is_accepted:
            yield f"'{expected.name}' {'failed' if verdict.status == 'failed' else 'was not exercised'}"


def _goldens(loaded: LoadedScenario) -> Iterator[tuple[Path, Expectation, Matches]]:
    """Yield each golden file of a scenario, with the expectation that matches it. Raise InvalidScenario."""
    for expected in loaded.scenario.expect:
        for leaf in expected.assertion.leaves():
            if isinstance(leaf, Matches):
                try:
                    name = leaf.file_of(loaded.source.values_in_file_names)
                    path = loaded.workspace.new_file(name)
                    foreign = is_foreign(path, is_golden)
                except (GoldenError, PathError) as error:
                    raise _refusal(expected, str(error)) from None
                except OSError as error:
                    raise _refusal(expected, f"{name} cannot be written: {error.strerror}") from None
                if foreign:
                    unlike = f"{name} is not a golden trajectory, and is not overwritten"
                    raise _refusal(expected, f"{unlike}; name another file, or remove it")
                yield path, expected, leaf


def _with_places(plan: Plan) -> Plan:
    """Return the plan if all of its golden files may be written, else its refusal."""
    if isinstance(plan, Refused):
        return plan
    try:
        _ = [golden for run in plan for golden in _goldens(run)]
    except InvalidScenario as error:
        return plan[0].source.refused(error)
    return plan


def _planned(plan: Plan, writers: Mapping[Path, list[str]]) -> Plan:
    """Return the plan with all moments recorded, or a refusal if another run writes the same file."""
    if isinstance(plan, Refused):
        return plan
    goldens = [golden for run in plan for golden in _goldens(run)]
    for path, expected, matches in goldens:
        if len(runs := writers[path]) > 1:
            others = f"{matches.trace} would be written {len(runs)} times, by '{runs[0]}' and '{runs[1]}'"
            ways = "put $variation into its name, or select one run with --only or --backend"
            return plan[0].source.refused(_refusal(expected, f"{others}; {ways}"))
    return tuple(run.traced_at_every_step() for run in plan) if goldens else plan


def _written(
    scene: Scene, trace: Trace, expected: Expectation, matches: Matches, *, allow: Sequence[str], reason: str
) -> str:
    name = matches.file_in(scene)
    seen = trace.between(expected.after, expected.before)
    try:
        path = scene.workspace.new_file(name)
        golden = replace(Golden.of_trace(matches.form_in(scene), seen, matches.rate), forced=reason)
        if len(golden.rows) < 2 and SINGLE_ROW not in allow:
            raise _refusal(expected, f"{name} is not written: {single_row(name, golden)} [{SINGLE_ROW}]")
        is_new = golden.write(path)
    except OSError as error:
        raise _refusal(expected, f"{name} cannot be written: {error.strerror}") from None
    except (PathError, ValueError) as error:
        raise _refusal(expected, str(error)) from None
    rows = f"{len(golden.rows)} rows, to {golden.time[-1]:.2f} s"
    return f"wrote {name}: {rows}" if is_new else f"{name} is unchanged: {rows}"


def _refusal(expected: Expectation, message: str) -> InvalidScenario:
    return InvalidScenario([Problem(expected.location, message)])
