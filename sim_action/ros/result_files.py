"""The XML files of results that rostest and launch_testing write, with one case for each method of a test.

A test of ROS 1 writes `rosunit-NAME.xml` with its methods, rostest `rostest-FILE.xml` with its tests (rosunit's
xmlrunner.py). The files may be cut short or hold characters that XML forbids.
"""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.results.outcome import ExpectationOutcome
from sim_action.state.verdict import Judged, Verdict

UNPUBLISHED: Final = "unpublished"  # the name of the property of a topic without a publisher; `ros_patches` writes it
_MAX_RESULT_BYTES: Final = 16_000_000
_MAX_CASES: Final = 1_000
# XML 1.0 forbids these characters, also as character references.
_FORBIDDEN: Final = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_REFERENCE: Final = re.compile(r"&#(?:x([0-9a-fA-F]{1,8})|([0-9]{1,8}));")
_MAX_CODE_POINT: Final = 0x10FFFF
_CDATA: Final = re.compile(r"\A\s*<!\[CDATA\[\n?(.*?)\n?\]\]>\s*\Z", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Case:
    """One method of a test, or one test of a file; `problem`: "failure", "error" or "skipped"; None: it passed."""

    name: str
    problem: str | None = None
    type: str = ""
    text: str = ""


def expectation_of(
    case: Case, assertion: str, where: Location, time: float | None, said: str = ""
) -> ExpectationOutcome:
    """Return the verdict of a case; `said`: why it failed, `time`: of the end, in s of sim time."""
    if case.problem == "skipped":
        reason = f" ({case.text.strip()})" if case.text.strip() else ""
        message = f"never checked: the test skipped this case{reason}; let it run, or remove it"
        verdict = Verdict(False, message=escaped_line(message), judged=Judged())
    else:
        verdict = Verdict(
            passed=case.problem is None, time=time, message=escaped_line(said) if case.problem else "held"
        )
    return expectation(case.name, assertion, where, verdict)


def expectation(name: str, assertion: str, where: Location, verdict: Verdict) -> ExpectationOutcome:
    """Return the outcome of an expectation of a test."""
    return ExpectationOutcome(
        name=name or "unnamed", assertion=assertion, severity="error", location=where, verdict=verdict
    )


@dataclass(frozen=True, slots=True)
class Suite:
    """The content of one result file."""

    cases: tuple[Case, ...]
    output: str = ""  # the output of its tests
    unpublished: tuple[str, ...] = ()  # topics that its tests listened to, and that never had a publisher


def read_suite(path: Path) -> Suite | None:
    """Read a result file; None if it is empty or cannot be understood."""
    try:
        data = read_at_most(path, _MAX_RESULT_BYTES)
    except OSError:
        return None
    root = _parsed(data) if data is not None else None
    if root is None:
        return None
    cases = islice(root.iter("testcase"), _MAX_CASES)
    output = "\n".join(filter(None, (_plain(root.findtext(f"system-{name}") or "") for name in ("out", "err"))))
    topics = (tag.get("value", "") for tag in root.iter("property") if tag.get("name") == UNPUBLISHED)
    return Suite(tuple(map(_case, cases)), output, tuple(islice(topics, _MAX_CASES)))


def _parsed(data: bytes) -> ET.Element | None:
    text = _REFERENCE.sub(_allowed, _FORBIDDEN.sub("", data.decode("utf-8", errors="replace")))
    # Results have no reason to declare entities.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        return None
    try:
        return ET.fromstring(text.encode())  # noqa: S314 - without a DTD, and of bounded size
    except ET.ParseError:
        return None


def _allowed(reference: re.Match[str]) -> str:
    number = int(reference[1], 16) if reference[1] else int(reference[2])
    return "" if number > _MAX_CODE_POINT or _FORBIDDEN.match(chr(number)) else reference[0]


def _case(element: ET.Element) -> Case:
    name = element.get("name", "")
    for problem in (child for child in element if child.tag in ("error", "failure", "skipped")):
        return Case(name, problem.tag, problem.get("type", ""), problem.text or problem.get("message") or "")
    # googletest writes this for a test whose name begins with DISABLED_.
    return Case(name, "skipped", "", "it is disabled") if element.get("status") == "notrun" else Case(name)


def _plain(text: str) -> str:
    match = _CDATA.match(text)
    return (match[1] if match else text).strip("\n")
