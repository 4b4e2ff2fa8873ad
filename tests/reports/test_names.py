"""Every name that a scenario may have reaches its reader unchanged in each report, and is nothing but text there."""

from __future__ import annotations

import html
import io
import re
import shlex
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from sim_action.core.field_types import is_title
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.reports import ReportOptions
from sim_action.reports.comparison import comparison_markdown
from sim_action.reports.escaping import one_line
from sim_action.reports.github.annotations import write_annotations
from sim_action.reports.github.job_summary import write_summary
from sim_action.reports.html.report import page
from sim_action.reports.junit import write_junit
from sim_action.reports.links import rerun_command
from sim_action.reports.terminal import print_results
from sim_action.results.artifacts import trace_paths
from sim_action.results.comparison import Thresholds, compare_outcomes
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import balanced
from sim_action.scenario.selection import Selection, selected
from sim_action.scenario.source import Source
from tests.outcomes import like
from tests.reports.samples import SAMPLES, results_of
from tests.soak import examples

NAMES = (
    "gap < 1 m",
    "a | b",
    "`x` > <b>&amp;</b>",
    "a\\|b",
    "100 % $x$ ~~y~~ *z* _w_ #1 @u [l](x)",
    "\"q\" 'q' a:b,c;d=e!",
)
TITLES = (
    st.text(st.sampled_from("|<>&`\\*_~#@$%[](){}\"':;,=!? ab1é"), min_size=1, max_size=40)
    .map(lambda text: " ".join(text.split()))
    .filter(lambda text: bool(text) and is_title(text))
)


def with_names(test: Callable[..., None]) -> Callable[..., None]:
    """Run a test with many names, and with some that were refused once."""
    for name in NAMES:
        test = example(name=name)(test)
    checks = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
    return given(name=TITLES)(settings(examples(20), suppress_health_check=checks)(test))


def failed(name: str) -> Outcome:
    """Return a failed scenario that is called so, with an expectation that is called so."""
    outcome = SAMPLES["failed"].outcomes[2]
    return like(outcome, name=name, expectations=tuple(like(each, name=name) for each in outcome.expectations))


@with_names
def test_in_junit_xml(options: ReportOptions, name: str) -> None:
    write_junit(results_of(failed(name)), options)
    suite = ET.parse(options.junit).getroot().find("testsuite")
    assert suite is not None
    assert suite.get("name") == name
    assert [case.get("name") for case in suite.iter("testcase")] == [f"{name}: {name}"]


class Shown(HTMLParser):
    """The text that a browser shows, and the elements."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text = ""
        self.elements: list[str] = []
        self.feed(text)
        self.close()

    def handle_data(self, data: str) -> None:
        self.text += data

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.elements.append(tag)


@with_names
def test_in_html(options: ReportOptions, name: str) -> None:
    plain, named = (Shown(b"".join(page(results_of(failed(each)), options).body).decode()) for each in ("plain", name))
    assert name in named.text
    assert named.elements == plain.elements


def cells(markdown: str) -> list[list[str]]:
    """Return the cells of each row of a table, as GitHub splits them."""
    return [re.split(r"(?<!\\)\|", line)[1:-1] for line in markdown.splitlines() if line.startswith("|")]


def assert_plain(markdown: str, name: str, plain: str) -> None:
    """The name is there as text, and changes neither the table nor the elements."""
    # As GitHub renders it: entities, and the zero-width spaces against mentions.
    assert name in html.unescape(markdown).replace("\u200b", "")
    assert [len(row) for row in cells(markdown)] == [len(row) for row in cells(plain)]
    blocks = re.compile(r"^(`{3,}).*?^\1$", re.MULTILINE | re.DOTALL)
    assert Shown(blocks.sub("", markdown)).elements == Shown(blocks.sub("", plain)).elements


@with_names
def test_in_the_job_summary(options: ReportOptions, tmp_path: Path, name: str) -> None:
    texts = []
    for each in ("plain", name):
        file = tmp_path / "summary.md"
        file.unlink(missing_ok=True)
        environment = {**options.environment, "GITHUB_STEP_SUMMARY": str(file)}
        write_summary(results_of(failed(each)), replace(options, environment=environment))
        texts.append(file.read_text(encoding="utf-8"))
    plain, named = texts
    assert_plain(named, name, plain)


@with_names
def test_in_a_comparison(name: str) -> None:
    def compared(name: str) -> str:
        old = like(failed(name), status="passed", expectations=())
        return comparison_markdown(compare_outcomes([old], [failed(name)], Thresholds()))

    assert_plain(compared(name), name, compared("plain"))


@with_names
def test_in_annotations(options: ReportOptions, capsys: pytest.CaptureFixture[str], name: str) -> None:
    capsys.readouterr()
    write_annotations(results_of(failed(name)), replace(options, environment={"GITHUB_ACTIONS": "true"}))
    [line] = capsys.readouterr().out.splitlines()
    command = re.fullmatch(r"::error ([^:]*)::.*", line)
    assert command
    properties = dict(pair.split("=", maxsplit=1) for pair in command[1].split(","))
    assert unquote(properties["title"]) == f"{name}: {name}"


@with_names
def test_on_the_terminal(options: ReportOptions, name: str) -> None:
    stream = io.StringIO()
    print_results(results_of(failed(name)), replace(options, environment={}), stream)
    assert name in " ".join(stream.getvalue().split())
    # The command that runs it again has it, too.
    words = shlex.split(rerun_command(failed(name), options))
    assert words[words.index("--only") + 1] == name


@with_names
def test_in_names_of_files(tmp_path: Path, name: str) -> None:
    first, second = trace_paths([name, name], tmp_path)
    assert first != second
    assert re.fullmatch(r"[A-Za-z0-9._-]+\.npz", first.name)
    assert first.parent == second.parent == tmp_path / "traces"


@with_names
def test_as_a_pattern_of_a_selection(tmp_path: Path, name: str) -> None:
    workspace = Workspace(tmp_path, tmp_path)
    names = (name, "another", f"{name} too")
    every = [Source(tmp_path / "a.sim.yml", workspace, Document("a.sim.yml", {}, {}), each, 1) for each in names]
    assert [each.name for each in selected([tuple(every)], Selection(only=(name,))).scenarios[0]] == [name]
    rest = selected([tuple(every)], Selection(exclude=(name,))).scenarios[0]
    assert [each.name for each in rest] == [each for each in names if each != name]


def test_names_do_not_change_on_one_line() -> None:
    assert [one_line(name) for name in NAMES] == list(NAMES)
    assert balanced([NAMES], [1.0], 1) == [[NAMES]]
