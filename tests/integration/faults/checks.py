"""The promises that hold under every fault; each check yields the promises that a run has broken."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import junitparser

from tests.integration.faults.injection import Fault, Run, sim_action
from tests.integration.faults.suite import SUFFIX

_JUDGED: Final = frozenset({"passed", "failed"})
_ON_TERMINAL: Final = re.compile(r"^(✓|✗|‼|passed|failed|error) {1,2}(\w.*?)(?:  .*)?$", re.MULTILINE)
_ON_PROGRESS: Final = re.compile(r"^\[\d+/\d+\] (\w+) +(.+?)(?:  .*)?$", re.MULTILINE)


_HALF: Final = re.compile(r"\.[0-9a-f]{16}\.").match  # True for the name of a file that is not completely written


@dataclass(frozen=True)
class Undisturbed:
    """A run of the same suite without a fault: its exit code and the outcome of each scenario."""

    code: int
    outcomes: Mapping[str, Any]
    cache: Path


def undisturbed(run: Run, cache: Path) -> Undisturbed:
    """Return the results of a run without a fault; all ways to know a verdict agree on them."""
    outcomes = _outcomes(run.output / "results.json")
    statuses = _statuses(outcomes)
    assert set(statuses.values()) <= _JUDGED
    assert _known(run) == _statuses(_printed(run)) == statuses
    assert _statuses(_journal(run.output)) == statuses
    assert not list(_same_in_junit(run.output / "junit.xml", outcomes))
    return Undisturbed(run.code, outcomes, cache)


def broken_promises(run: Run, fault: Fault, usual: Undisturbed) -> Iterator[str]:
    """Yield each promise that the run has broken."""
    if "Traceback" in run.errors or "Traceback" in run.printed:
        yield "a traceback was printed"
    if run.code == 3:
        yield "the exit code is 3: a fault of sim-action"
    if run.left:
        yield f"processes are left: {run.left}"
    killed = run.code == -signal.SIGKILL
    if not killed and (files := [path.name for path in run.tmp.iterdir()]):
        yield f"temporary files are left: {files}"
    if fault.signal != signal.SIGKILL and (files := [path.name for path in run.output.rglob(".*") if _HALF(path.name)]):
        yield f"unfinished files are left in the output folder: {files}"
    yield from _kept_in_journal(run, usual) if killed else _kept_in_reports(run, fault, usual)


def kept(run: Run, usual: Undisturbed) -> int:
    """Return the number of scenarios whose verdict is known after the run, and is that of an undisturbed run."""
    known = _journal(run.output) | _printed(run) | _outcomes(run.output / "results.json")
    return sum(outcome["status"] == usual.outcomes[name]["status"] for name, outcome in known.items())


def _kept_in_reports(run: Run, fault: Fault, usual: Undisturbed) -> Iterator[str]:
    """Yield the promises about a run that came to its end."""
    stored, junit = _outcomes(run.output / "results.json"), run.output / "junit.xml"
    found = stored or _printed(run)
    if not found and _is_refused(run, fault):
        return
    if missing := usual.outcomes.keys() - found.keys():
        yield f"not accounted for: {sorted(missing)}"
    lost = [name for name, outcome in found.items() if outcome["status"] not in _JUDGED]
    if len(set(lost) - set(fault.exempt)) > fault.most_lost:
        yield f"without a verdict: {sorted(lost)}"
    for name, outcome in found.items():
        yield from _same_verdict(name, outcome, fault, usual)
        yield from _evidence(name, stored.get(name, {}), run, fault, usual)
    if forgotten := _known(run).items() - _statuses(found).items():
        yield f"reported as finished, and lost later: {sorted(forgotten)}"
    if junit.exists():
        yield from _same_in_junit(junit, found)
    elif _printed(run).keys() != usual.outcomes.keys():
        yield "there is no JUnit XML, and the verdicts are not on standard output"
    yield from _exit_code(run, fault, usual, complete=bool(stored) and not lost and not missing)


def _exit_code(run: Run, fault: Fault, usual: Undisturbed, *, complete: bool) -> Iterator[str]:
    """Yield a wrong exit code; `complete`: the results hold every verdict."""
    written = [(run.output / name).exists() for name in ("junit.xml", "report.html")]
    if run.code == 0 and not (complete and written[0]):
        yield "the exit code is 0, and a verdict, the results or the JUnit XML is missing"
    if complete and all(written) and not fault.signal and run.code != usual.code:
        yield f"every verdict and report is there, but the exit code is {run.code} and not {usual.code}"


def _cause(fault: Fault) -> str:
    """Return words that the message of a scenario without a verdict must contain."""
    if fault.error:
        return os.strerror(fault.error).lower()
    return "sigkill" if fault.target == "self" else "interrupted" if fault.signal else ""


def _is_refused(run: Run, fault: Fault) -> bool:
    """Return True if the command ended with the reason of the system before any scenario started."""
    has_reason = bool(fault.error) and _cause(fault) in run.errors.lower()
    return has_reason and run.code in (1, 2) and not _journal(run.output, "started")


def _same_verdict(name: str, outcome: Any, fault: Fault, usual: Undisturbed) -> Iterator[str]:
    """Yield a verdict that an undisturbed run has not, and a missing one without the true cause."""
    expected = usual.outcomes[name]
    if outcome["status"] in _JUDGED:
        differing = [key for key in ("status", "digest") if outcome.get(key, expected[key]) != expected[key]]
        if differing:
            yield f"'{name}' has another {' and '.join(differing)} than usual"
    elif (messages := _messages(outcome)) and _cause(fault) not in messages.lower():
        yield f"'{name}' does not name the cause, {_cause(fault)}: {messages}"


def _evidence(name: str, outcome: Any, run: Run, fault: Fault, usual: Undisturbed) -> Iterator[str]:
    """Yield a file that is named and does not exist, and one that is missing without a note of the cause."""
    for kind in ("trace", "replay"):
        file, notes = outcome.get(kind), " ".join(outcome.get("notes", ())).lower()
        if file is not None and not (run.output / file).is_file():
            yield f"'{name}' names a {kind} that does not exist: {file}"
        is_missing = file is None and bool(outcome) and bool(usual.outcomes[name].get(kind))
        if is_missing and outcome["status"] in _JUDGED and _cause(fault) not in notes:
            yield f"'{name}' has no {kind}, and no note about it: {notes}"


def _same_in_junit(path: Path, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield differences between the JUnit XML and the other results."""
    suites = {str(suite.name).removesuffix(SUFFIX): suite for suite in junitparser.JUnitXml.fromfile(str(path))}
    if suites.keys() != found.keys():
        yield f"JUnit has {sorted(suites)}"
    for name, suite in suites.items():
        status = found.get(name, {}).get("status")
        words = "error" if suite.errors else "failed" if suite.failures else "skipped" if suite.skipped else "passed"
        if status in {*_JUDGED, "error", "skipped"} and words != status:
            yield f"'{name}' {words} in JUnit, and {status} in the results"


def _kept_in_journal(run: Run, usual: Undisturbed) -> Iterator[str]:
    """Yield the promises about a command that was killed: its journal has all that was known."""
    journal = _journal(run.output)
    if missing := _known(run).items() - _statuses(journal).items():
        yield f"reported as finished, and not in the journal: {sorted(missing)}"
    for name, outcome in journal.items():
        if outcome["status"] in _JUDGED and outcome["digest"] != usual.outcomes[name]["digest"]:
            yield f"'{name}' has another digest in the journal"
    if not journal:
        return
    report = sim_action(run.output.parent, usual.cache, {}, "report", str(run.output))
    expected = usual.code if journal.keys() == usual.outcomes.keys() else 130
    if "Traceback" in report.stderr or report.returncode != expected:
        yield f"report ended with {report.returncode}: {report.stderr}"
    outcomes = _outcomes(run.output / "results.json")
    for name in usual.outcomes:
        status = outcomes.get(name, {}).get("status")
        if status != journal.get(name, {"status": "error"})["status"]:
            yield f"'{name}' is {status} in the reports of the journal"
    yield from _same_in_junit(run.output / "junit.xml", outcomes)


def _messages(outcome: Any) -> str:
    failures = outcome.get("failures", ())
    return "; ".join(f"{failure['title']}: {failure['message']}" for failure in failures)


def _outcomes(path: Path) -> dict[str, Any]:
    """Return the outcomes by name; nothing if there is no such file."""
    if not path.exists():
        return {}
    outcomes = json.loads(path.read_text(encoding="utf-8"))["outcomes"]
    assert len(set(map(_name, outcomes))) == len(outcomes)
    return {_name(outcome): outcome for outcome in outcomes}


def _name(outcome: Any) -> str:
    """Return the name of a scenario; one that cannot be read has the name of its file."""
    return str(outcome["name"]).removesuffix(SUFFIX)


def _journal(folder: Path, event: str = "finished") -> dict[str, Any]:
    """Return the last record of each scenario that has one for this event; the last line may be cut off."""
    path = folder / "results.jsonl"
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []
    header, *records = map(json.loads, lines) if lines else [{}]
    return {
        _name(header["planned"][record["place"]]): record.get("outcome")
        for record in records
        if record["event"] == event
    }


def _printed(run: Run) -> dict[str, Any]:
    """Return the outcomes on standard output: the name and the status of each scenario."""
    found: dict[str, dict[str, str]] = {}
    for symbol, name in _ON_TERMINAL.findall(run.printed):
        found[name.removesuffix(SUFFIX)] = {"status": {"✓": "passed", "✗": "failed", "‼": "error"}.get(symbol, symbol)}
    return found


def _known(run: Run) -> dict[str, str]:
    """Return the verdict of each scenario that was reported as finished while others ran."""
    progress = _ON_PROGRESS.findall(run.printed + run.errors)
    return {name: status for status, name in progress if status in _JUDGED}


def _statuses(outcomes: Mapping[str, Any]) -> dict[str, str]:
    return {name: outcome["status"] for name, outcome in outcomes.items()}
