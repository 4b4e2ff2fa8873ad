"""The JUnit XML writer, for Jenkins, GitLab and the reporters on GitHub.

A testsuite is a scenario with all of its variations. A testcase is an expectation, with a failure if it did not hold,
and an error of the type "not_exercised" if it was never judged. If a scenario has no verdict, each reason is a
testcase with an error. If it was not run, one testcase is skipped.

A testsuite is also a gate, with one testcase for all of its runs: these are no testcases, and no failures, of their
own. Where another call judges the gate, its testcase is skipped.

Reporters title a testcase by its file, class name, name or suite, and each of them omits some of these. So the name of
a testcase begins with the name of its scenario, and its class name is the file.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import PurePosixPath
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import whole_file
from sim_action.reports import ReportOptions, formatting
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS
from sim_action.reports.escaping import one_line, plain_text
from sim_action.reports.links import file_and_line, relative_path, stored_trace
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.output_folder import JUNIT_NAME
from sim_action.results.results_json import RESULTS_FILE, Results
from sim_action.scenario.variations.gate import GATE
from sim_action.world.claims import AuditWarning

_ENDINGS: Final = re.compile(r"(?<=[^/])(\.sim)?\.(yml|yaml|test|launch)$")
_MAX_RUNS_OF_GATE: Final = 20
# The properties of each variation: variations may have run on different machines.
_OF_EACH: Final = ("engine", "seed", "digest", "repeats", "cpu", "engine_build")


def write_junit(results: Results, options: ReportOptions) -> None:
    """Write the JUnit XML to `options.junit` completely or not at all, and create its folders."""
    parts = _Document(results, options).parts()
    options.junit.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(options.junit) as file:
        file.writelines(parts)


class _Document:
    """One document while it is built."""

    def __init__(self, results: Results, options: ReportOptions) -> None:
        self._results = results
        self._options = options
        self._taken: defaultdict[str, set[str]] = defaultdict(set)
        # The last number tried for a name, so that many equal names do not take quadratic time.
        self._numbers: dict[tuple[str, str], int] = {}

    def parts(self) -> Iterable[bytes]:
        """Return the encoded document in parts."""
        suites = PackedParts()
        totals = Counter(dict.fromkeys(("tests", "failures", "errors"), 0))
        for group in grouped_scenarios(self._results.outcomes, self._results.gates):
            suite_totals = self._suite(group, suites)
            totals.update({name: suite_totals[name] for name in totals})
        root = element("testsuites", {"name": JUNIT_NAME, **totals, "time": _seconds(self._results.wall_time)})
        declaration = b"<?xml version='1.0' encoding='utf-8'?>\n"
        if not self._results.outcomes:
            return [declaration + element_lines(root, "").removesuffix("\n").encode()]
        return chain([declaration, start_tag(root).encode(), b">\n"], suites, [b"</testsuites>"])

    def _suite(self, group: ScenarioGroup, suites: PackedParts) -> Mapping[str, int]:
        """Add the testsuite of a scenario, and return its totals."""
        cases, measured = PackedParts(), PackedParts()
        totals = dict.fromkeys(("tests", "failures", "errors", "skipped"), 0)
        for outcome in (group.gate or group.outcomes[0],) if group.is_gate else group.outcomes:
            run = [self._gate(group)] if group.is_gate else self._run(group, outcome)
            for case in run:
                totals["tests"] += 1
                for kind, name in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
                    totals[name] += case.find(kind) is not None
            cases.add(encoded("".join([element_lines(case, INDENT * 2) for case in run])))
            if not group.is_gate:
                measured.add(encoded(property_lines(_measured(group, outcome, run))))
        file = relative_path(self._options.workspace, group.location.file) if group.location else None
        time = sum(outcome.wall_time for outcome in group.outcomes)
        started = self._results.started_at
        timestamp = None if started is None else started.isoformat(timespec="seconds")
        host = next((member.provenance.host for member in group.outcomes if member.provenance is not None), None)
        ran = {"time": _seconds(time), "timestamp": timestamp, "hostname": host}
        suite = element("testsuite", {"name": _name(group.name), **totals, **ran, "file": file})
        inner = INDENT * 2
        suites.add(encoded(f"{INDENT}{start_tag(suite)}>\n{inner}<properties>\n"))
        suites.add(encoded(property_lines(self._suite_properties(group))))
        for part in chain(measured, [f"{inner}</properties>\n".encode()], cases):
            suites.add(part)
        suites.add(f"{INDENT}</testsuite>\n".encode())
        return totals

    def _run(self, group: ScenarioGroup, outcome: Outcome) -> list[ET.Element]:
        """Return the testcases of one run."""
        values = group.values(outcome)
        cases = [self._expectation(group, outcome, expected) for expected in outcome.expectations]
        cases += [self._error(group, outcome, failure) for failure in _reasons(outcome)]
        cases += [self._warning(group, outcome, warning) for warning in outcome.failing_warnings]
        if outcome.status == "skipped":
            case = self._case(group, outcome, "not run", outcome.location)
            add_child(case, "skipped", "", {"message": " ".join(outcome.notes) or "not run"})
            cases.append(case)
        for index, case in enumerate(cases):
            # Only the first testcase has the time of the run, because tools add up the times of testcases.
            case.set("time", _seconds(outcome.wall_time if index == 0 else 0.0))
            if values and not self._options.junit_strict:
                add_properties(case, _of_variation(outcome))
        _add_output(outcome, cases)
        return cases

    def _suite_properties(self, group: ScenarioGroup) -> dict[str, object]:
        """Return the properties of a run; for variations, the digest of each and the worst one."""
        ours = {
            "sim_action": self._results.sim_action,
            "python": self._results.python,
            "platform": self._results.platform,
        }
        if group.is_gate:
            return {**ours, "engine": group.engines or None, **_made_with(group.outcomes[0]), **_counts(group)}
        if not group.varies:
            return ours | _ran(group.worst)
        digests = {f"digest: {group.values(outcome)}": outcome.digest for outcome in group.outcomes}
        worst = None if group.status == "skipped" else group.worst_text
        made = _made_with(group.worst)
        engines = group.engines or None
        return {**ours, "engine": engines, **made, "passed": group.passed, "worst": worst, **digests}

    def _gate(self, group: ScenarioGroup) -> ET.Element:
        """Return the testcase of a gate; it is skipped if another call judges the gate."""
        shown = group.gate or next(iter(group.could_not_run), group.outcomes[0])
        claims = () if group.gate is None else group.gate.causes or group.gate.expectations
        stated = shown.location if group.planned is None else group.planned.location
        location = next((claim.location for claim in claims), stated)
        case = self._case(group, shown, GATE, location)
        case.set("time", _seconds(sum(outcome.wall_time for outcome in group.outcomes)))
        if not self._options.junit_strict:
            add_properties(case, _counts(group))
        message = group.ending
        if group.status == "skipped":
            add_child(case, "skipped", "", {"message": message})
        elif kind := STATUS_DISPLAYS[group.status].junit:
            problem = GATE if group.status == "failed" else group.status
            add_child(case, kind, self._body(message, GATE, location), {"type": problem, "message": message})
        for outcome in group.not_passed[:1]:
            self._attach_trace(case, outcome)
        for line in _output_of_gate(group):
            add_line(case, "system-out", line)
        return case

    def _expectation(self, group: ScenarioGroup, outcome: Outcome, expected: ExpectationOutcome) -> ET.Element:
        case = self._case(group, outcome, expected.name, expected.location)
        message = outcome.message_of(expected)
        if not self._options.junit_strict:
            add_properties(case, _case_properties(expected))
        if expected.verdict.cut_off:
            add_child(case, "skipped", "", {"message": message})
        elif kind := STATUS_DISPLAYS[expected.status].junit:
            body = self._body(message, expected.name, expected.location)
            problem = expected.assertion if expected.failed else expected.status
            add_child(case, kind, body, {"type": problem, "message": message})
        self._attach_trace(case, outcome)
        add_line(case, "system-out", f"warning: {message}" if expected.warned else message)
        add_line(case, "system-out", formatting.measurements(expected.verdict))
        add_line(case, "system-out", formatting.judged_text(expected.verdict))
        return case

    def _error(self, group: ScenarioGroup, outcome: Outcome, failure: Failure) -> ET.Element:
        location = failure.location or outcome.location
        case = self._case(group, outcome, failure.title, location)
        message = f"{failure.title}: {failure.message}"
        body = self._body(message, failure.title, location)
        if failure.details:
            body += f"\n\n{failure.details}"
        add_child(case, "error", body, {"type": failure.kind, "message": message})
        self._attach_trace(case, outcome)
        return case

    def _warning(self, group: ScenarioGroup, outcome: Outcome, warning: AuditWarning) -> ET.Element:
        """Return the testcase of a warning that makes a run fail."""
        case = self._case(group, outcome, warning.rule, warning.location)
        body = self._body(warning.message, warning.rule, warning.location)
        add_child(case, "failure", body, {"type": warning.rule, "message": warning.message})
        return case

    def _case(self, group: ScenarioGroup, outcome: Outcome, name: str, location: Location | None) -> ET.Element:
        classname = self._classname(group)
        file = relative_path(self._options.workspace, location.file) if location else ""
        values = group.values(outcome) if group.varies and outcome.gate is None else ""
        full = f"{_prefix(group)}{_name(f'{name} {values}' if values else name)}"
        names = {"classname": classname, "name": self._unique((classname, file), full)}
        if self._options.junit_strict or location is None:
            return element("testcase", names)
        return element("testcase", {**names, "file": file, "line": location.line})

    def _classname(self, group: ScenarioGroup) -> str:
        """Return the file of a scenario without its endings; the name of a scenario without a file."""
        if group.location is None:
            return _name(group.name)
        file = relative_path(self._options.workspace, group.location.file)
        return _name(_ENDINGS.sub("", file))

    def _unique(self, places: tuple[str, str], name: str) -> str:
        """Return a unique name: tools identify a testcase across suites by its name, and by its class name or file."""
        unique, number = name, self._numbers.get((places[0], name), 1)
        while any(unique in self._taken[place] for place in places):
            number += 1
            unique = f"{name} ({number})"
        if number > 1:
            self._numbers[places[0], name] = number
        for place in places:
            self._taken[place].add(unique)
        return unique

    def _body(self, message: str, name: str, location: Location | None) -> str:
        """Return the message and the place: alone, and in the form of a stack trace that reporters search for."""
        if location is None:
            return message
        where = file_and_line(self._options.workspace, location)
        return "\n".join((message, where, f"at {one_line(name)}({where})", *_java_frame(where)))

    def _attach_trace(self, case: ET.Element, outcome: Outcome) -> None:
        trace = stored_trace(outcome, self._options.folder)
        if trace is not None:
            # In the syntax of the Jenkins plugin and of GitLab.
            path = plain_text(relative_path(self._options.workspace, trace))
            _append(case, "system-out", f"{_ATTACHMENT}{path}]]")


def _reasons(outcome: Outcome) -> tuple[Failure, ...]:
    """Return the reasons why there is no verdict; never empty for such an outcome, as a suite needs a testcase."""
    if outcome.failures or outcome.status == "skipped" or (outcome.expectations and outcome.has_verdict):
        return outcome.failures
    return (
        Failure(
            kind="internal",
            title="no verdict",
            message="the results contain no expectation and no failure of this scenario",
        ),
    )


def _ran(outcome: Outcome) -> dict[str, object]:
    factor = outcome.real_time_factor
    return {
        "engine": outcome.engine,
        "end": outcome.end,
        "sim_time_s": outcome.sim_time,
        "real_time_factor": None if factor is None else f"{factor:.4g}",
        "travelled_m": outcome.travelled,
        "seed": outcome.seed,
        "digest": outcome.digest,
        "repeats": outcome.repeats.count if outcome.repeats else None,
        **_made_with(outcome),
    }


def _made_with(outcome: Outcome) -> dict[str, object]:
    if outcome.provenance is None:
        return {}
    made = outcome.provenance.model_dump(exclude={"host"})
    return {**made, "packages": ", ".join(outcome.provenance.packages) or None}


def _output_of_gate(group: ScenarioGroup) -> Iterator[str]:
    """Yield the claims of a gate, the worst of the runs that did not pass, and each warning once for all runs."""
    bad = group.not_passed
    for expected in group.gate.expectations if group.gate is not None else ():
        yield f"{expected.name}: {expected.verdict.message}"
    if bad:
        yield f"{group.not_passed_text}; the worst first:"
    yield from (f"- {group.values(run)} {run.ending}" for run in bad[:_MAX_RUNS_OF_GATE])
    if len(bad) > _MAX_RUNS_OF_GATE:
        yield f"- {len(bad) - _MAX_RUNS_OF_GATE} more, see {RESULTS_FILE}"
    for expected, share in group.warned:
        yield f"warning: {expected.name}: {share}"
    for warning, runs in group.warnings:
        yield f"warning: {warning.location}: {group.warning_text(warning, runs)}"
    yield from (f"note: {note}" for note in dict.fromkeys(note for run in group.outcomes for note in run.model_notes))


def _counts(group: ScenarioGroup) -> dict[str, object]:
    """Return the counts and bounds of a gate; for runs that another call judges, only their number."""
    if group.gate is None or group.gate.statistics is None:
        passed = sum(outcome.status == "passed" for outcome in group.outcomes)
        return {"runs": len(group.outcomes), "passed": passed, "planned": group.planned and group.planned.runs}
    counts = group.gate.statistics
    names = ("rate", "lower", "upper", "confidence", "runs", "planned", "passed", "failed", "errors", "not_exercised")
    return {name: getattr(counts, name) for name in (*names, "decision")}


def _of_variation(outcome: Outcome) -> dict[str, object]:
    values = {f"variation: {varied.key}": json.dumps(varied.value) for varied in outcome.variation}
    return values | {name: entry for name, entry in _ran(outcome).items() if name in _OF_EACH}


def _add_output(outcome: Outcome, cases: list[ET.Element]) -> None:
    """Add notes and output to the first testcase that failed: Jenkins hides the output of a suite otherwise."""
    unhappy = (case for case in cases if case.find("failure") is not None or case.find("error") is not None)
    case = next(unhappy, cases[0])
    add_line(case, "system-out", f"timeline: {happened}" if (happened := formatting.timeline_text(outcome)) else "")
    for warning in outcome.warnings:
        add_line(case, "system-out", f"warning: {warning.location}: {warning}")
    for measured in outcome.measurements:
        add_line(case, "system-out", f"{INFORMATION.word}: {' '.join(formatting.measured_text(measured)).strip()}")
    for note in (*outcome.model_notes, *outcome.notes):
        add_line(case, "system-out", f"note: {note}")
    add_line(case, "system-out", formatting.user_output(outcome))
    for diagnostic in outcome.diagnostics:
        add_line(case, "system-err", f"{diagnostic.level}: {diagnostic.message}")


def _java_frame(where: str) -> Iterator[str]:
    """Yield the place as dorny/test-reporter finds it: folder as lower-case package, a class, file without folders."""
    path, _, line = where.rpartition(":")
    folder = PurePosixPath(path).parent.name
    if folder[:1] > "Z" and "." not in folder and line.isdigit():
        yield f"at {folder}.Scenario({PurePosixPath(path).name}:{line})"


def _case_properties(expected: ExpectationOutcome) -> dict[str, object]:
    verdict = expected.verdict
    judged = verdict.judged
    return {
        "assertion": expected.assertion,
        "severity": expected.severity,
        "measured": verdict.measured,
        "limit": verdict.limit,
        "margin": verdict.margin,
        "unit": verdict.unit,
        "sim_time_s": verdict.time,
        "judged_moments": judged and judged.moments,
        "judged_from_s": judged and judged.first,
        "judged_to_s": judged and judged.last,
        **dict(text.split(": ", 1) for text in formatting.spread_texts(expected)),
    }


def _measured(group: ScenarioGroup, outcome: Outcome, cases: list[ET.Element]) -> dict[str, object]:
    """Return the measured values as properties of the suite: a strict schema has no properties of testcases."""
    values = group.values(outcome)
    names = (case.attrib["name"].removeprefix(_prefix(group)) for case in cases)
    pairs = zip(names, (expected.verdict for expected in outcome.expectations), strict=False)
    judged: dict[str, object] = {
        f"measured: {name}": f"{verdict.measured:.9g} {verdict.unit}".rstrip()
        for name, verdict in pairs
        if verdict.measured is not None
    }
    # They are no testcases: a testcase without a failure would be a pass.
    unjudged = {
        f"{INFORMATION.word}: {one_line(f'{measurement.name} {values}'.rstrip())}": (
            f"{measurement.measured:.9g} {measurement.unit}".rstrip()
        )
        for measurement in outcome.measurements
    }
    events = {
        f"event: {one_line(name)}": ", ".join(f"{time:.3f} s" for time in times) or "never"
        for name, times in outcome.events.items()
    }
    actors = {f"actor: {one_line(name)}": one_line(model) for name, model in outcome.actors.items()}
    return judged | unjudged | events | actors


def _prefix(group: ScenarioGroup) -> str:
    return f"{_name(group.name)}: "


def _name(text: str) -> str:
    return one_line(text) or "unnamed"


def _seconds(value: float) -> str:
    return f"{value:.3f}"


_PART_BYTES: Final = 500_000
_LEVEL: Final = 1  # a higher level takes several times as long and saves little


class PackedParts:
    """A text in UTF-8 that grows at its end, is read from its beginning, and waits packed: it has megabytes."""

    def __init__(self) -> None:
        """Begin an empty text."""
        self._packed: list[bytes] = []
        self._last: list[bytes] = []
        self._bytes = 0

    def add(self, part: bytes) -> None:
        """Add text at the end."""
        self._last.append(part)
        self._bytes += len(part)
        if self._bytes >= _PART_BYTES:
            self._packed.append(zlib.compress(b"".join(self._last), _LEVEL))
            self._last = []
            self._bytes = 0

    def __iter__(self) -> Iterator[bytes]:
        """Yield the text in parts."""
        for packed in self._packed:
            yield zlib.decompress(packed)
        yield from self._last


_ATTACHMENT: Final = "[[ATTACHMENT|"


def element(tag: str, attributes: Mapping[str, object]) -> ET.Element:
    """Return an element with the attributes that are not None."""
    texts = {name: plain_text(str(value)) for name, value in attributes.items() if value is not None}
    return ET.Element(tag, texts)


def add_child(parent: ET.Element, tag: str, text: str, attributes: Mapping[str, object] | None = None) -> None:
    """Add a child element with text."""
    child = element(tag, attributes or {})
    child.text = _harmless(text)
    parent.append(child)


def add_line(parent: ET.Element, tag: str, text: str) -> None:
    """Append lines to the single child element with this tag, unless the text is empty."""
    if text:
        _append(parent, tag, _harmless(text))


def add_properties(parent: ET.Element, values: Mapping[str, object]) -> None:
    """Add the properties that are not None in the first child."""
    properties = parent.find("properties")
    if properties is None:
        properties = ET.Element("properties")
        parent.insert(0, properties)
    properties.extend(_properties(values))


def _properties(values: Mapping[str, object]) -> Iterator[ET.Element]:
    for name, value in values.items():
        if value is not None:
            text = f"{value:.9g}" if isinstance(value, float) else value
            yield element("property", {"name": name, "value": text})


def property_lines(values: Mapping[str, object]) -> str:
    """Return the lines of the properties of a suite."""
    return "".join([element_lines(child, INDENT * 3) for child in _properties(values)])


INDENT: Final = "  "
_SPECIAL: Final = re.compile('[&<>"\r\n\t]')
_IN_TEXT: Final = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_IN_ATTRIBUTE: Final = _IN_TEXT | str.maketrans({'"': "&quot;", "\r": "&#13;", "\n": "&#10;", "\t": "&#09;"})


def element_lines(item: ET.Element, indent: str) -> str:
    """Return an element with its children on lines of their own, as `ElementTree.indent` and `write` do."""
    start = f"{indent}{start_tag(item)}"
    if len(item):
        children = "".join([element_lines(child, indent + INDENT) for child in item])
        return f"{start}>\n{children}{indent}</{item.tag}>\n"
    if not item.text:
        return f"{start} />\n"
    text = item.text.translate(_IN_TEXT) if _SPECIAL.search(item.text) else item.text
    return f"{start}>{text}</{item.tag}>\n"


def start_tag(item: ET.Element) -> str:
    """Return the start tag of an element without its end."""
    texts = [
        f' {name}="{value.translate(_IN_ATTRIBUTE) if _SPECIAL.search(value) else value}"'
        for name, value in item.attrib.items()
    ]
    return f"<{item.tag}{''.join(texts)}"


def encoded(text: str) -> bytes:
    """Return text in UTF-8; half a surrogate pair becomes a character reference."""
    return text.encode("utf-8", errors="xmlcharrefreplace")


def _append(parent: ET.Element, tag: str, text: str) -> None:
    child = parent.find(tag)
    if child is None:
        child = ET.SubElement(parent, tag)
    child.text = f"{child.text}\n{text}" if child.text else text


def _harmless(text: str) -> str:
    return plain_text(text).replace(_ATTACHMENT, "[[ATTACHMENT |")
