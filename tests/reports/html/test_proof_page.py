"""The page of a proof: findings as plain HTML, and survivors beside the run without a mutant."""

from __future__ import annotations

import json
import re
from pathlib import Path

from sim_action.recording.replay.replay_data import write_replay
from sim_action.reports.html.document import Page
from sim_action.reports.html.proof_page import ShownScenario, proof_page, write_proof_page
from tests.outcomes import like, outcome, report_options
from tests.reports.proofs import FAILED, PROOF, PROVEN, UNKNOWN
from tests.reports.replays import replay


def shown(folder: Path) -> list[ShownScenario]:
    names = ["burger turns", *(f"burger turns ({each.name})" for each in PROVEN.survivors)]
    (folder / "replays").mkdir()
    runs = []
    for number, name in enumerate(names):
        write_replay(replay(), folder / f"replays/{number}.json.gz")
        runs.append(like(outcome("a.sim.yml"), name=name, replay=f"replays/{number}.json.gz"))
    return [ShownScenario(UNKNOWN), ShownScenario(FAILED), ShownScenario(PROVEN, runs[0], runs[1:])]


def page(folder: Path) -> Page:
    return proof_page(PROOF, shown(folder), report_options(folder), folder)


def test_the_findings_are_plain_html(tmp_path: Path) -> None:
    text = page(tmp_path).text()
    assert "checks nothing here: 5 mutants changed the run, 2 of them noticed by others; not exercised in: h" in text
    assert "- reach: {x: 1}\n  before: 2" in text
    assert "failed (travelled 1 m)" in text
    assert "b.sim.yml:6" in text
    assert "No expectation was found that would have noticed it" in text
    assert "e: script error: stuck" in text
    assert text.count("<svg") >= 4
    assert text.count("<article") == 3 + len(PROVEN.survivors)
    # Every link inside the page has its target.
    targets = set(re.findall(r'<article id="(s\d+)"', text))
    assert set(re.findall(r'href="#(s\d+)"', text)) == targets


def test_scenarios_with_a_useless_expectation_come_first(tmp_path: Path) -> None:
    names = re.findall(r'<h2 id="s\d+-name">(.*?)</h2>', page(tmp_path).text())
    runs = ("burger turns", "burger turns (b)", "burger turns (f)", "burger turns (g)")
    assert names == [*runs, "lamp", "burger fails"]


def test_the_run_without_a_mutant_is_a_ghost_of_a_survivor(tmp_path: Path) -> None:
    found = page(tmp_path)
    entries = json.loads(found.index)["scenarios"]
    own, *survivors = entries[:4]
    assert own["kind"] == "scenario"
    assert own["ghosts"] == []
    assert [ghost["replay"] for each in survivors for ghost in each["ghosts"]] == [own["replay"]] * len(survivors)
    assert all(ghost["shown"] for each in survivors for ghost in each["ghosts"])
    assert {each["kind"] for each in survivors} == {"sample"}
    assert set(found.blocks) == {each["replay"] for each in entries[:4]}
    assert all(each["replay"] is None for each in entries[4:])


def test_a_page_without_any_run_is_written(tmp_path: Path) -> None:
    empty = like(PROOF, scenarios=(like(FAILED, file=""),))
    write_proof_page(empty, [ShownScenario(empty.scenarios[0])], report_options(tmp_path), tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert "<nav" not in text
    assert "No mutants" in text


def test_names_are_escaped(tmp_path: Path) -> None:
    hostile = "</script><img src=x>"
    runs = [like(outcome("a.sim.yml"), name=hostile)] * 3
    scenarios = [ShownScenario(like(PROVEN, name=hostile, file=hostile), None, runs)]
    assert "<img" not in proof_page(PROOF, scenarios, report_options(tmp_path), tmp_path).text()
