"""`python -m tests.integration.github`: what it prints, and its exit code."""

from __future__ import annotations

import fcntl
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.integration.github.__main__ import main
from tests.integration.github.conftest import CHECKOUT, uses
from tests.integration.github.test_caching import RESTORE, SAVE

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


KEY = "results-${{ github.run_id }}-${{ github.run_attempt }}"
COUNTS = f"""\
on: push
jobs:
  count:
    runs-on: ubuntu-latest
    steps:
{uses(CHECKOUT)}\
{uses(RESTORE, {"path": "count", "key": KEY, "restore-keys": "results-${{ github.run_id }}-"})}\
      - run: |
          ls -A .. "$RUNNER_TEMP"; echo "left" > ../left; echo "left" > "$RUNNER_TEMP/left"
          echo "$PWD $GITHUB_RUN_ID $GITHUB_RUN_NUMBER $GITHUB_RUN_ATTEMPT" >> count; cat count
{uses(SAVE, {"path": "count", "key": KEY})}\
"""


def test_a_run_has_a_new_number_and_its_attempts_share_the_caches(workflow: Path, tmp_path: Path) -> None:
    workflow.write_text(COUNTS, encoding="utf-8")
    kept = tmp_path / "kept"
    (kept / "run-7").mkdir(parents=True)
    # In each call, the workspace has the same path, and nothing else of an earlier call.
    workspace = kept / "work/robots/robots"
    arguments: list[list[str]] = [[], ["--rerun"], ["--rerun"], []]
    for call in arguments:
        done = called(workflow, "--folder", kept, *call)
        assert (done.exit_code, "warning" in done.output) == (0, False)
    logs = [(kept / f"run-{name}/count.log").read_text("utf-8") for name in ("8-attempt-3", "9")]
    found = [[line for line in log.splitlines() if line.startswith("/") and line[-1].isdigit()] for log in logs]
    assert found == [[f"{workspace} 8 8 {attempt}" for attempt in (1, 2, 3)], [f"{workspace} 9 9 1"]]
    assert not any("left" in log for log in logs)


def test_there_must_be_a_run_to_repeat(workflow: Path, tmp_path: Path) -> None:
    refused = called(workflow, "--folder", tmp_path, "--rerun")
    assert (refused.exit_code, "there is no run in" in refused.output) == (2, True)


def test_two_calls_never_share_a_folder(workflow: Path, tmp_path: Path) -> None:
    with (tmp_path / "last_run").open("w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        refused = called(workflow, "--folder", tmp_path)
    assert (refused.exit_code, "another call uses" in refused.output) == (2, True)


def test_a_pull_request_has_a_number(workflow: Path, tmp_path: Path) -> None:
    number = "${{ github.event.number }} ${{ github.event.pull_request.number }}"
    workflow.write_text(WORKFLOW.replace("$GITHUB_EVENT_NAME", number), encoding="utf-8")
    called(workflow, "--folder", tmp_path, "--event", "pull_request")
    assert (tmp_path / "run-1/greet-summary.md").read_text(encoding="utf-8") == "1 1\n"


def test_the_token_of_a_fork_may_only_read(workflow: Path, tmp_path: Path) -> None:
    writes = "permissions: {checks: write}\njobs:"
    text = WORKFLOW.replace("jobs:", writes) + (
        "      - uses: mikepenz/action-junit-report@d9f48fc87bc235f7e214acf696ca5abc0a986f16\n"
        "        with: {report_paths: junit.xml}\n"
    )
    workflow.write_text(text, encoding="utf-8")
    assert "it needs 'checks: write'" in called(workflow, "--folder", tmp_path, "--fork").output
    assert "no test report files were found" in called(workflow, "--folder", tmp_path, "--event", "pull_request").output


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


def test_a_workflow_elsewhere_needs_the_repository(workflow: Path, tmp_path: Path) -> None:
    moved = workflow.rename(tmp_path / "hello.yml")
    assert "--workspace" in called(moved).output
    assert called(moved, "--workspace", tmp_path / "repository", "--folder", tmp_path / "kept").exit_code == 0
