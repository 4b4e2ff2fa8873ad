"""`python -m tests.integration.github`: what it prints, and its exit code."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.integration.github.__main__ import main
from tests.integration.github.conftest import CHECKOUT

UPLOAD = "actions/upload-artifact@043fb46d1a93c77aae656e7c1c64a875d1fc6a0a"
WORKFLOW = f"""\
name: hello
on: [push, pull_request]
jobs:
  greet:
    runs-on: ubuntu-latest
    steps:
      - uses: {CHECKOUT}
      - run: |
          echo "$GITHUB_EVENT_NAME" >> "$GITHUB_STEP_SUMMARY"
          echo "::error file=robot.yml,line=3::too fast"
          mkdir results && cp verdict results/verdict
          exit "$(cat verdict)"
      - uses: {UPLOAD}
        if: ${{{{ !cancelled() }}}}
        with: {{name: results, path: results}}
"""


@pytest.fixture
def workflow(repository: Path) -> Path:
    (repository / "verdict").write_text("0", encoding="utf-8")
    file = repository / ".github/workflows/hello.yml"
    file.write_text(WORKFLOW, encoding="utf-8")
    return file


def called(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_a_workflow_is_green_then_red_and_both_runs_are_kept(workflow: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    green = called(workflow, "--folder", kept)
    assert (green.exit_code, green.output.splitlines()[-1]) == (0, "conclusion: success")
    assert "error robot.yml:3: too fast" in green.output
    (workflow.parents[2] / "verdict").write_text("1", encoding="utf-8")
    red = called(workflow, "--folder", kept, "--event", "pull_request")
    assert (red.exit_code, red.output.splitlines()[-1]) == (1, "conclusion: failure")
    assert (kept / "run-2/greet-summary.md").read_text(encoding="utf-8") == "pull_request\n"
    results = [(kept / f"run-{number}/artifacts/results/verdict").read_text("utf-8") for number in (1, 2)]
    assert results == ["0", "1"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (CHECKOUT, "actions/checkout@v4", "uses: actions/checkout@v4"),
        ("on: [push, pull_request]", "on: pull_request", "the event push does not start this workflow"),
    ],
)
def test_what_it_does_not_know_is_refused(workflow: Path, tmp_path: Path, old: str, new: str, message: str) -> None:
    workflow.write_text(WORKFLOW.replace(old, new), encoding="utf-8")
    refused = called(workflow, "--folder", tmp_path / "kept")
    assert refused.exit_code == 2
    assert message in refused.output
