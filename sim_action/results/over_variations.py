"""Warnings and verdicts that only all variations of a scenario together give: those of the audit, and of gates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sim_action.results.gates import judged_gate
from sim_action.results.outcome import Outcome
from sim_action.scenario.sharing import share_parts
from sim_action.scenario.variations.gate import PlannedGate
from sim_action.world.claims import AuditWarning


def over_variations(
    outcomes: Sequence[Outcome], gates: Iterable[PlannedGate], *, is_part: bool = False
) -> tuple[Outcome, ...]:
    """Return the outcomes of a call, each gate before its first run, and without warnings that do not hold for all.

    Outcomes of gates among `outcomes` are judged anew. Runs of a gate that is not among `gates` count by themselves:
    nothing else would judge them. `is_part`: runs of a gate may be in other results; such a gate has no outcome.
    """
    known = {(gate.file, gate.name): gate for gate in gates}
    runs = [
        run if run.gate is None or (run.file, run.gate) in known else run.model_copy(update={"gate": None})
        for run in _audited_over_variations([outcome for outcome in outcomes if outcome.statistics is None])
    ]
    samples: dict[tuple[str, str], list[Outcome]] = {}
    for run in runs:
        if run.gate is not None:
            samples.setdefault((run.file, run.gate), []).append(run)
    judged = {
        key: judged_gate(gate, samples[key])
        for key, gate in known.items()
        if key in samples and not (is_part and len(samples[key]) < gate.runs)
    }
    found: list[Outcome] = []
    for run in runs:
        if run.gate is not None and (gate := judged.pop((run.file, run.gate), None)) is not None:
            found.append(gate)
        found.append(run)
    return tuple(found)


def _audited_over_variations(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Return the outcomes without the warnings that count only if all variations of a scenario have them.

    A variation without a verdict, or one that a broken expectation ended early, says nothing about the others.
    """
    counted: dict[tuple[str, str | None], list[AuditWarning]] = {}
    for outcome in outcomes:
        if outcome.group is not None and outcome.has_verdict and outcome.end != "expectation failed":
            found = [warning for warning in outcome.warnings if warning.is_over_variations]
            same = counted.setdefault((outcome.file, outcome.group), found)
            same[:] = [warning for warning in same if warning in found]
    return [_audited(outcome, counted.get((outcome.file, outcome.group))) for outcome in outcomes]


def _audited(outcome: Outcome, shared: Sequence[AuditWarning] | None) -> Outcome:
    if shared is None or all(warning in shared for warning in outcome.warnings if warning.is_over_variations):
        return outcome
    kept = tuple(warning for warning in outcome.warnings if not warning.is_over_variations or warning in shared)
    return share_parts(outcome.model_copy(update={"warnings": kept}), outcome)
