"""."""

from __future__ import annotations

import base64
import gzip
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.files import whole_file
from sim_action.reports import ReportOptions
from sim_action.reports.html.report import page, write_html
from sim_action.reports.links import replay_link
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.replays import drive, kept
from tests.reports.html.gates import failed_gate
from tests.reports.samples import HOSTILE, SAMPLES, results_of

ON_GITHUB = {"GITHUB_SERVER_URL": "https://github.com", "GITHUB_REPOSITORY": "a/b", "GITHUB_SHA": "c0ffee"}


def body(results: Results, options: ReportOptions) -> str:
    return b"".join(page(results, options).body).decode()


def test_golden(kind: str, options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden(f"{kind}.html", f"{body(SAMPLES[kind], replace(options, environment=ON_GITHUB))}\n")


def ran(options: ReportOptions) -> Outcome:
    options.folder.mkdir()
    return like(SAMPLES["cut"].outcomes[0], replay=kept(drive(), options.folder, "cut"))


def test_the_page_is_one_file_with_failures_first(options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    # The page is one file with all that it needs.
    results = results_of(ran(options))
    golden("replay.html", f"{body(results, options)}\n")
    write_html(results, options)
    text = (options.folder / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=[\"'](?!#|data:|https://github)", text)
    assert 'id="replay-s0"' in text
    assert 'id="meshes"' in text
    # Failures first.
    outcomes = [like(SAMPLES[kind].outcomes[0], name=kind) for kind in ("passed", "failed", "crash")]
    names = re.findall(r"<h2[^>]*>(.*?)</h2>", body(results_of(*outcomes), options))
    assert names == ["All scenarios", "crash", "failed", "passed"]


def test_many_articles_are_text_until_they_are_opened(options: ReportOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "</noscript><script>globalThis.pwned = 1</script>"
    results = results_of(like(SAMPLES["passed"].outcomes[0], name=name), *failed_gate().outcomes)
    plain = body(results, options)
    monkeypatch.setattr("sim_action.reports.html.report.MAX_PARSED_ARTICLES", 1)
    packed = body(results, options)
    assert packed.replace("<noscript>", "").replace("</noscript>", "") == plain
    inside = re.findall(r'<article id="s\d+"[^>]*><noscript>(.*?)</noscript></article>', packed, re.DOTALL)
    assert len(inside) == len(re.findall(r'<article id="s\d+"', plain))
    assert all("</article>" not in article for article in inside)


def test_links_tell_runs_of_one_name_apart(options: ReportOptions) -> None:
    passed, failed, crash = (like(SAMPLES[kind].outcomes[0], name="a") for kind in ("passed", "failed", "crash"))
    first = like(passed, replay="replays/a.json.gz")
    second = like(failed, replay="replays/a-2.json.gz")
    entries = json.loads(page(results_of(first, second, crash), options).index)["scenarios"]
    numbers = {entry["status"]: entry["number"] for entry in entries}
    assert numbers == {"error": 3, "failed": 2, "passed": 1}
    links = [replay_link(outcome, options) for outcome in (first, second)]
    assert links == ["report.html#scenario=a", "report.html#scenario=a&n=2"]


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf])
def test_a_time_that_is_none_leaves_the_index_what_a_browser_can_read(time: float, options: ReportOptions) -> None:
    cut, parted = SAMPLES["cut"].outcomes[0], SAMPLES["flaky"].outcomes[1]
    judged = [like(expected, verdict=replace(expected.verdict, time=time)) for expected in cut.expectations]
    failed = [like(failure, time=time) for failure in parted.failures]
    strange = like(cut, expectations=tuple(judged)), like(parted, failures=failed)

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    json.loads(page(results_of(*strange), options).index, parse_constant=refuse)


def test_the_page_is_the_same_and_without_markup_of_strangers(options: ReportOptions) -> None:
    # Nothing of a stranger is markup.
    text = page(SAMPLES["hostile"], options).text()
    assert "<b>" not in text.replace("<b>warning", "")
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert HOSTILE.split()[1] == "<b>&</b>"
    # The same results make the same page.
    results = results_of(ran(options))
    assert page(results, options).text() == page(results, options).text()


@pytest.mark.parametrize("where", ["../elsewhere.json.gz", "replays/missing.json.gz", "/etc/passwd", "a\x00b"])
def test_a_replay_that_is_not_below_the_results_is_not_looked_for(
    where: str, options: ReportOptions, tmp_path: Path
) -> None:
    lost = like(ran(options), replay=where)
    kept(drive(), tmp_path, "elsewhere")
    found = page(results_of(lost), options)
    assert "The replay file of this run is missing" in found.text()
    assert not found.blocks


def test_a_replay_that_is_none_is_told_and_the_rest_is_there(options: ReportOptions) -> None:
    broken = ran(options)
    with whole_file(options.folder / "replays/cut.json.gz") as file:
        file.write(b"no gzip")
    shown = page(results_of(broken), options).text()
    assert "The replay cannot be read:" in shown
    assert "base_link touched wall" in shown


def test_what_finds_no_room_has_no_replay_and_says_so(options: ReportOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_action.reports.html.document.MAX_REPLAY_BYTES", 100)
    found = page(results_of(ran(options)), options)
    assert "The replay of this run is not included" in found.text()
    assert "<svg" not in b"".join(found.body).decode()
    assert not found.blocks


def test_of_thousands_the_worst_are_told_and_the_rest_is_counted(
    options: ReportOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim_action.reports.html.report.MAX_PAGE_SCENARIOS", 2)
    outcomes = [like(SAMPLES[kind].outcomes[0], name=kind) for kind in ("passed", "failed", "crash")]
    found = body(results_of(*outcomes), options)
    assert re.findall(r"<h2[^>]*>(.*?)</h2>", found) == ["All scenarios", "crash", "failed"]
    assert "1 more scenario in results.json; this page shows the worst 2" in found
    assert re.findall(r'href="#(s\d+)"', found) == ["s0", "s1"] * 2


def test_a_gate_carries_the_data_of_its_plot_and_no_viewer_without_a_replay(options: ReportOptions) -> None:
    found = page(failed_gate(), options)
    entries = json.loads(found.index)["scenarios"]
    shown = [(entry["kind"], entry["sweep"], entry["replay"]) for entry in entries[:2]]
    assert shown == [("gate", "sweep-s0", None), ("sample", None, None)]
    data = json.loads(gzip.decompress(base64.b64decode(found.blocks["sweep-s0"])))
    assert [parameter["name"] for parameter in data["parameters"]] == ["friction", "yaw"]
    assert data["entries"] == [f"s{number}" for number in range(1, 31)]
    assert not found.has_replays


def test_the_worst_runs_of_a_gate_have_a_replay_first(options: ReportOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    options.folder.mkdir()
    gate = failed_gate()
    name = kept(drive(), options.folder, "push")
    runs = tuple(each if each.statistics is not None else like(each, replay=name) for each in gate.outcomes)
    results = like(gate, outcomes=runs)
    monkeypatch.setattr("sim_action.reports.html.document.MAX_REPLAY_BYTES", 8_000)
    found = page(results, options)
    kept_runs = [key for key in found.blocks if key.startswith("replay-")]
    assert kept_runs == [f"replay-s{number}" for number in range(1, len(kept_runs) + 1)]
    assert 1 < len(kept_runs) < 30
    text = b"".join(found.body).decode()
    assert text.count('<td data-title="Replay">yes</td>') == len(kept_runs)
    assert text.count("The replay of this run is not included") == 30 - len(kept_runs)
