"""The reports of a proof on GitHub."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.reports import ReportOptions
from sim_action.reports.proof import (
    proof_outputs,
    proof_summary,
    write_proof_annotations,
    write_proof_outputs,
    write_proof_summary,
)
from sim_action.results.proof import Proof
from tests.outcomes import like
from tests.reports.proofs import FAILED, INVALID, PROOF, PROVEN, UNKNOWN, expected


def options(folder: Path, **environment: str) -> ReportOptions:
    return ReportOptions(folder, folder / "junit.xml", junit_strict=False, environment=environment, workspace=folder)


def proof(*scenarios: object, **changes: object) -> Proof:
    return like(PROOF, scenarios=scenarios, **changes)


GOOD = like(UNKNOWN, name="good", expectations=(expected("reach", finding="notices", noticed=("a",)),))


def test_the_summary_has_what_to_do_first(tmp_path: Path) -> None:
    text = proof_summary(proof(GOOD, PROVEN, FAILED), options(tmp_path))
    assert text.startswith("## ❌ 1 expectation checks nothing\n\n1 expectation checks nothing, 2 notice something, ")
    assert "| ❌ | upright<br><code>a.sim.yml:8</code> | checks nothing here: 5 mutants changed the run" in text
    pasted = "This expectation would have noticed them:\n\n```yaml\n- reach: {x: 1}\n  before: 2\n```"
    assert text.count(pasted) == 1
    assert "not mutated: failed (travelled 1 m)<br><code>b.sim.yml:6</code>" in text
    assert "No expectation was found that would have noticed it" in text
    assert text.index("### burger turns") < text.index("### burger fails") < text.index("<details>")
    assert text.index("<details>") < text.index("### good")


@pytest.mark.parametrize(
    ("found", "title"),
    [
        (proof(GOOD), "✅ Every expectation notices something"),
        (proof(GOOD, UNKNOWN), "⚠️ No expectation is known to check nothing"),
        (proof(GOOD, FAILED), "⚠️ No expectation is known to check nothing"),
        (proof(), "⚠️ No scenarios were run"),
        (proof(PROVEN, interrupted=True), "🛑 Proof interrupted"),
    ],
)
def test_the_title(found: Proof, title: str, tmp_path: Path) -> None:
    assert proof_summary(found, options(tmp_path)).splitlines()[0] == f"## {title}"


def test_a_summary_keeps_to_its_size(tmp_path: Path) -> None:
    many = proof(*[PROVEN] * 100)
    text = proof_summary(many, options(tmp_path), 20_000)
    assert len(text.encode()) <= 20_000
    assert "more scenarios not shown" in text
    assert proof_summary(many, options(tmp_path), 100) == ""


def test_the_summary_is_appended_where_github_wants_it(tmp_path: Path) -> None:
    write_proof_summary(PROOF, options(tmp_path))
    file = tmp_path / "summary.md"
    for _ in range(2):
        write_proof_summary(PROOF, options(tmp_path, GITHUB_STEP_SUMMARY=str(file)))
    assert file.read_text().count("## ❌") == 2


@pytest.mark.parametrize("strict", [False, True])
def test_an_annotation_is_at_the_line_of_the_expectation(
    strict: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_proof_annotations(PROOF, options(tmp_path), strict=strict)
    assert capsys.readouterr().out == ""
    write_proof_annotations(PROOF, options(tmp_path, GITHUB_ACTIONS="true"), strict=strict)
    first, *rest = capsys.readouterr().out.splitlines()
    level = "error" if strict else "warning"
    assert first.startswith(
        f"::{level} file=a.sim.yml,line=8,col=5,title=checks nothing%3A upright::burger turns".replace(
            " turns", "%0Aturns"
        )
    )
    assert [line.split("::")[1] for line in rest] == (
        [
            "error file=b.sim.yml,line=6,col=5,title=not mutated%3A burger fails",
            "error file=a.sim.yml,line=8,col=5,title=unknown%3A settled",
        ]
        if strict
        else []
    )


def test_an_invalid_scenario_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_proof_annotations(proof(PROVEN, INVALID), options(tmp_path, GITHUB_ACTIONS="true"), strict=False)
    assert [line.split(",")[:3] for line in capsys.readouterr().out.splitlines()] == [
        ["::error file=d.sim.yml", "line=3", "col=9"],
        ["::warning file=a.sim.yml", "line=8", "col=5"],
    ]


def test_of_many_annotations_the_last_one_counts_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    many = proof(*(INVALID for _ in range(12)))
    write_proof_annotations(many, options(tmp_path, GITHUB_ACTIONS="true"), strict=False)
    *shown, last = capsys.readouterr().out.splitlines()
    assert len(shown) == 9
    assert last == "::error title=sim-action::3 more errors: see the job summary"


def test_the_outputs_count(tmp_path: Path) -> None:
    found = proof_outputs(PROOF, options(tmp_path))
    report = str(tmp_path / "report.html")
    assert found == {"unproven": "1", "survivors": "3", "not-mutated": "1", "report-path": report}
    silenced = ReportOptions(tmp_path, tmp_path / "j", False, {}, tmp_path, silenced=frozenset({"report"}))
    assert proof_outputs(PROOF, silenced)["report-path"] == ""
    write_proof_outputs(PROOF, options(tmp_path, GITHUB_OUTPUT=str(tmp_path / "outputs")))
    assert "\n3\n" in (tmp_path / "outputs").read_text()
