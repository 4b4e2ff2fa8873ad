"""The report of a proof on a terminal."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from sim_action.reports import ReportOptions
from sim_action.reports.proof import (
    finding_text,
    headline,
    print_proof,
    proof_outputs,
    proof_summary,
    write_proof_annotations,
    write_proof_outputs,
    write_proof_summary,
)
from sim_action.results.proof import Proof, ProvenScenario
from tests.outcomes import like, report_options
from tests.reports.proofs import FAILED, INVALID, PROOF, PROVEN, UNKNOWN, expected

GOOD = like(PROVEN, expectations=PROVEN.expectations[:1])


def test_the_report() -> None:
    stream = io.StringIO()
    print_proof(PROOF, {}, stream)
    assert stream.getvalue().splitlines() == [
        "burger turns  a.sim.yml:3",
        "  ✓ reach: notices 8 of 9: a, b, c, d, e, f and 2 more; 25% from its limit",
        "  ✗ upright: checks nothing here: 5 mutants changed the run, 2 of them noticed by others; not exercised in: h",
        "      a.sim.yml:8:5",
        "  ! b: b fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "  ! g: g fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "      this expectation would have noticed them:",
        "        - reach: {x: 1}",
        "          before: 2",
        "  ! f: f fault: the robot was 0.80 m further left at 3.1 s, and nothing failed",
        "      no expectation was found that would have noticed it",
        "  unnoticed, with little other motion: c",
        "  no effect: d",
        "  could not run: e: script error: stuck",
        "  left out: 2 mutants",
        "",
        "burger fails  b.sim.yml",
        "  not mutated: failed (travelled 1 m)",
        "      b.sim.yml:6:5",
        "",
        "lamp  c.sim.yml",
        "  ∅ settled: unknown: no mutant changed the run",
        "",
        headline(PROOF),
    ]


@pytest.mark.parametrize(
    ("keys", "counts", "reason"),
    [
        ({}, {}, "no mutant changed the run"),
        ({"not_exercised": ("doubled",)}, {}, "no other mutant changed the run; not exercised in: doubled"),
        ({"changed": 1}, {"left_out": 8}, "it noticed none of 1 mutant that changed the run; 8 mutants were left out"),
        (
            {},
            {"left_out": 1, "unfinished": 2},
            "no mutant changed the run; 1 mutant was left out; 2 mutants had not ended",
        ),
        ({"passed": False}, {"left_out": 1}, "it did not pass without a mutant either"),
    ],
)
def test_the_reason_why_nothing_is_known(keys: dict[str, object], counts: dict[str, int], reason: str) -> None:
    settled = expected("settled", finding="unknown", **keys)
    assert finding_text(settled, like(UNKNOWN, **counts)) == f"unknown: {reason}"


def test_shares_and_symbols() -> None:
    # A limit that is far away has no exact share.
    near, far = (expected("reach", finding="notices", sensitivity=share) for share in (10.0, 12.5))
    assert finding_text(near, UNKNOWN).endswith("; 1000% from its limit")
    assert finding_text(far, UNKNOWN).endswith("; more than 1000% from its limit")
    # Symbols that a stream cannot show are letters.
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    print_proof(PROOF, {}, stream)
    stream.seek(0)
    assert "  x upright: checks nothing here" in stream.read()


def test_headlines() -> None:
    # A headline without scenarios.
    empty = like(PROOF, scenarios=())
    assert headline(empty) == "0 expectations check nothing, 0 notice something"
    # The headline counts everything.
    told = headline(PROOF)
    assert told.startswith("1 expectation checks nothing, 1 notices something, 1 unknown, ")
    assert told.endswith(", 3 other motions unnoticed; 1 scenario not mutated")
    # An interruption is told.
    stream = io.StringIO()
    interrupted = like(PROOF, interrupted=True, scenarios=(like(PROVEN, unfinished=3),))
    print_proof(interrupted, {}, stream)
    assert "  not ended: 3 mutants\n" in stream.getvalue()
    assert headline(interrupted).startswith("interrupted before 3 mutants had ended: 1 expectation checks nothing")
    assert headline(like(PROOF, interrupted=True)).startswith("interrupted: 1 expectation")


@pytest.mark.parametrize(("scenarios", "colour"), [([PROVEN], "1;31"), ([UNKNOWN], "33"), ([], "33"), ([GOOD], "32")])
def test_the_headline_is_green_only_if_all_notice(scenarios: list[ProvenScenario], colour: str) -> None:
    stream = io.StringIO()
    print_proof(like(PROOF, scenarios=scenarios), {"FORCE_COLOR": "1"}, stream)
    assert stream.getvalue().splitlines()[-1].startswith(f"\x1b[{colour}m")


def options(folder: Path, **environment: str) -> ReportOptions:
    return report_options(folder, environment=environment)


def proof(*scenarios: object, **changes: object) -> Proof:
    return like(PROOF, scenarios=scenarios, **changes)


NOTICED = like(UNKNOWN, name="good", expectations=(expected("reach", finding="notices", noticed=("a",)),))


def test_the_summary_has_what_to_do_first(tmp_path: Path) -> None:
    text = proof_summary(proof(NOTICED, PROVEN, FAILED), options(tmp_path))
    assert text.startswith("## ❌ 1 expectation checks nothing\n\n1 expectation checks nothing, 2 notice something, ")
    row = "| ❌ | **upright**<br><sub><code>a.sim.yml:8</code></sub> | checks nothing here: 5 mutants changed the run"
    assert row in text
    pasted = "This expectation would have noticed them:\n\n```yaml\n- reach: {x: 1}\n  before: 2\n```"
    assert text.count(pasted) == 1
    assert "not mutated: failed (travelled 1 m)<br><code>b.sim.yml:6</code>" in text
    assert "No expectation was found that would have noticed it" in text
    assert text.index("### burger turns") < text.index("### burger fails") < text.index("<details>")
    assert text.index("<details>") < text.index("### good")


@pytest.mark.parametrize(
    ("found", "title"),
    [
        (proof(NOTICED), "✅ Every expectation notices something"),
        (proof(NOTICED, UNKNOWN), "⚠️ No expectation is known to check nothing"),
        (proof(NOTICED, FAILED), "⚠️ No expectation is known to check nothing"),
        (proof(), "⚠️ No scenarios were run"),
        (proof(PROVEN, interrupted=True), "🛑 Proof interrupted"),
    ],
)
def test_the_title(found: Proof, title: str, tmp_path: Path) -> None:
    assert proof_summary(found, options(tmp_path)).splitlines()[0] == f"## {title}"


def test_the_summary_is_appended_within_its_size(tmp_path: Path) -> None:
    # A summary keeps to its size.
    many = proof(*[PROVEN] * 100)
    text = proof_summary(many, options(tmp_path), 20_000)
    assert len(text.encode()) <= 20_000
    assert "more scenarios not shown" in text
    assert proof_summary(many, options(tmp_path), 100) == ""
    # The summary is appended where github wants it.
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
    assert first.startswith(f"::{level} file=a.sim.yml,line=8,col=5,title=checks nothing%3A upright::burger%0Aturns")
    others = [
        "error file=b.sim.yml,line=6,col=5,title=not mutated%3A burger fails",
        "error file=a.sim.yml,line=8,col=5,title=unknown%3A settled",
    ]
    assert [line.split("::")[1] for line in rest] == (others if strict else [])


def test_annotations_of_proofs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # An invalid scenario is an error.
    write_proof_annotations(proof(PROVEN, INVALID), options(tmp_path, GITHUB_ACTIONS="true"), strict=False)
    assert [line.split(",")[:3] for line in capsys.readouterr().out.splitlines()] == [
        ["::error file=d.sim.yml", "line=3", "col=9"],
        ["::warning file=a.sim.yml", "line=8", "col=5"],
    ]
    # Of many annotations the last one counts the others.
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
