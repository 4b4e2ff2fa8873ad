"""Outcomes and results as runs leave them behind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from sim_action.core.errors import Location
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.reports import ReportOptions
from sim_action.results.gates import over_variations
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results, Shard
from sim_action.scenario.source import Source, Varied
from sim_action.scenario.variations.gate import Gate, PlannedGate
from sim_action.state.verdict import Judged, Verdict

Model = TypeVar("Model", bound=BaseModel)


def like(model: Model, **values: object) -> Model:
    """Return a copy with other values, which are not validated."""
    return model.model_copy(update=values)


def report_options(folder: Path, **stated: Any) -> ReportOptions:
    """Of a call whose output folder is the workspace."""
    made = ReportOptions(folder, folder / "junit.xml", junit_strict=False, environment={}, workspace=folder)
    return replace(made, **stated)


def outcome(
    file: str,
    *,
    holds: bool = True,
    wall_time: float = 1.0,
    trace: str | None = None,
    replay: str | None = None,
    number: int | None = None,
) -> Outcome:
    """Of a scenario with one expectation."""
    verdict = Verdict(holds, 1.5, 1.5, 0.0, "m", 2.0, "travelled 1.5 m")
    expected = ExpectationOutcome(
        name="travel", assertion="travel", severity="error", location=Location(file, 8, 5), verdict=verdict
    )
    return Outcome(
        name=Path(file).name.partition(".")[0],
        file=file,
        number=number,
        status="passed" if holds else "failed",
        expectations=(expected,),
        wall_time=wall_time,
        trace=trace,
        replay=replay,
    )


def source(file: str, number: int = 1, name: str | None = None, group: str | None = None) -> Source:
    """As it is read out of a file."""
    here = Workspace(Path(), Path())
    return Source(Path(file), here, Document(file, {}), name or Path(file).name, group=group, number=number)


def results(*outcomes: Outcome, shard: tuple[int, int, int] | None = None, wall_time: float = 1.0) -> Results:
    """Of one call; `shard`: its index, count and total."""
    part = Shard(index=shard[0], count=shard[1], total=shard[2]) if shard else None
    return Results(
        sim_action="0.1.0", python="3.11.7", platform="Linux", wall_time=wall_time, shard=part, outcomes=outcomes
    )


def stored(folder: Path, written: Results) -> Path:
    """`results.json` in a folder, and an own text for each trace and replay below it."""
    for kind in ("trace", "replay"):
        (folder / f"{kind}s").mkdir(parents=True)
        for made in written.outcomes:
            if name := getattr(made, kind):
                (folder / name).write_text(f"{kind} of {made.file}")
    (folder / "recordings").mkdir()
    for made in written.outcomes:
        for name in made.recordings:
            (folder / name).write_text(f"{name} of {made.file}")
    return written.write(folder)


def unjudged(file: str) -> Outcome:
    """Of a scenario whose one expectation was never judged."""
    made = outcome(file)
    verdict = Verdict(False, message="never checked: sensor 'lidar' had no reading", judged=Judged())
    expected = made.expectations[0].model_copy(update={"verdict": verdict})
    return made.model_copy(update={"status": "not_exercised", "expectations": (expected,)})


def as_former_version(path: Path, end: str | None = "nobody left", version: int = 1) -> None:
    """Rewrite a results.json in a former version of its format; version 1 has the former value of `end`."""
    document = json.loads(path.read_text())
    document["version"] = version
    if version == 1:
        document["some"] = document.pop("selected")
    for one in document["outcomes"]:
        del one["measurements"]
        one["end"] = end if version == 1 else one["end"]
        for expected in one["expectations"] if version < 3 else ():
            del expected["unexercised"], expected["verdict"]["judged"]
    path.write_text(json.dumps(document))


def planned_gate(runs: int = 61, name: str = "slip", **stated: object) -> PlannedGate:
    """A gate of 90 % with 95 % confidence, or as stated."""
    claims = stated or {"passes": {"at_least": "90 %", "confidence": "95 %"}}
    return PlannedGate(
        name=name,
        file="scenarios/slip.sim.yml",
        location=Location("scenarios/slip.sim.yml", 5, 1),
        group=name.partition("[")[0],
        gate=Gate.model_validate(claims),
        runs=runs,
    )


def runs_of_gate(planned: PlannedGate, **counts: int) -> list[Outcome]:
    """Runs of a gate: so many of each status, in this order, named by their friction."""
    statuses = [status for status, count in counts.items() for _ in range(count)]
    return [_run_of_gate(planned, number, status) for number, status in enumerate(statuses, start=1)]


def _run_of_gate(planned: PlannedGate, number: int, status: str) -> Outcome:
    made = outcome(planned.file, holds=status == "passed", number=number)
    friction = number / 100
    update: dict[str, object] = {
        "name": f"{planned.group}[friction={friction:g}]",
        "group": planned.group,
        "variation": (Varied("world.ground.friction", friction),),
        "gate": planned.name,
        "status": status,
        "engine": "PyBullet 3.2.7",
        "sim_time": 3.0,
        "scenario_seed": 7,
    }
    if status == "failed":
        short = Verdict(False, friction, 1.5, friction - 1.5, "m", 3.0, f"travelled {friction:g} m of 1.5 m in 3.0 s")
        update["expectations"] = (made.expectations[0].model_copy(update={"verdict": short}),)
    elif status == "not_exercised":
        update["expectations"] = unjudged(planned.file).expectations
    elif status in _FAILURES:
        update |= {"status": "error", "expectations": (), "failures": (_FAILURES[status],)}
    elif status == "skipped":
        update |= {"expectations": (), "notes": ("not run: another scenario did not pass (--fail-fast)",)}
    return made.model_copy(update=update)


_FAILURES = {
    "error": Failure(kind="crash", title="SIGSEGV", message="the process of this scenario was ended by SIGSEGV"),
    "interrupted": Failure(kind="interrupted", title="interrupted", message="the run was interrupted"),
}


def gate_results(planned: PlannedGate, *runs: Outcome, shard: tuple[int, int, int] | None = None) -> Results:
    """Of one call with a gate, judged unless some of its runs are in other shards."""
    judged = over_variations(runs, [planned], is_part=shard is not None)
    return results(*judged, shard=shard).model_copy(update={"gates": (planned,)})
