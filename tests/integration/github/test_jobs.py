"""Jobs: what their steps find on the machine, and the actions that they use."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.github import UnsupportedFeature
from tests.integration.github.conftest import CHECKOUT, Perform, job, results, workflow

ECHO = """
name: echo
inputs: {text: {default: nothing}}
outputs: {said: {value: "${{ steps.say.outputs.said }}"}}
runs:
  using: composite
  steps:
    - id: say
      shell: bash
      env: {TEXT: "${{ inputs.text }}"}
      run: echo "said=$TEXT" >> "$GITHUB_OUTPUT"; echo "$TEXT by $NAME, $GITHUB_ACTION_PATH"; [[ "$TEXT" != fail ]]
"""


def test_steps_after_a_failure(perform: Perform) -> None:
    jobs = job("a", "exit 2") + "      - run: true\n      - {run: 'echo reached', if: failure()}\n"
    result = perform(workflow(jobs))
    assert [step.outcome for step in result.jobs["a"].steps] == ["failure", "skipped", "success"]
    assert result.jobs["a"].runs[0].log == "reached\n"


def test_a_forgiven_step_leaves_the_job_alone(perform: Perform) -> None:
    jobs = job("a", "exit 2\n        continue-on-error: true") + "      - run: true\n"
    assert results(perform(workflow(jobs))) == {"a": "success"}


def test_each_job_has_a_fresh_machine(perform: Perform) -> None:
    leave = 'touch left "$RUNNER_TEMP/left"; echo LEFT=1 >> "$GITHUB_ENV"'
    result = perform(workflow(job("a", leave) + job("b", 'ls . "$RUNNER_TEMP"; echo "$LEFT"')))
    a, b = result.runs
    assert a.workspace != b.workspace
    assert "left" not in b.log
    assert (a.workspace / "left").exists()
    assert (a.temp / "left").exists()


def test_temp_can_be_shared(perform: Perform, tmp_path: Path) -> None:
    jobs = job("a", 'touch "$RUNNER_TEMP/left"') + job("b", 'test -e "$RUNNER_TEMP/left"')
    assert perform(workflow(jobs), shared_temp=tmp_path).conclusion == "success"


def test_environment_narrows_down(perform: Perform) -> None:
    jobs = job("a", 'echo "$A $B $C $D"', env="{A: job, B: job, C: 1}") + "        env: {B: '${{ env.A }} step'}\n"
    log = perform(workflow(jobs), variables={"C": "0", "D": "machine"}).runs[0].log
    assert log == "job job step 1 machine\n"


def test_local_actions_need_a_checkout(perform: Perform, repository: Path) -> None:
    (repository / "say").mkdir()
    (repository / "say/action.yml").write_text(ECHO, encoding="utf-8")
    steps = "      - {id: it, uses: ./say, with: {text: hello}, env: {NAME: me}}\n"
    steps += "      - run: echo ${{ steps.it.outputs.said }}\n"
    jobs = f"  a:\n    runs-on: ubuntu-latest\n    steps:\n      - uses: {CHECKOUT}\n{steps}"
    run = perform(workflow(jobs)).runs[0]
    assert run.log == f"hello by me, {run.workspace}/say\nhello\n"
    without = perform(workflow(jobs.replace(f"      - uses: {CHECKOUT}\n", ""))).jobs["a"]
    assert without.result == "failure"
    assert "forget to run actions/checkout" in without.annotations[0].message


def test_a_failing_action_fails_the_step_and_hands_its_outputs_on(perform: Perform, repository: Path) -> None:
    (repository / "action.yml").write_text(ECHO, encoding="utf-8")
    jobs = f"""
  a:
    runs-on: ubuntu-latest
    outputs: {{said: "${{{{ steps.it.outputs.said }}}} ${{{{ steps.it.outcome }}}}"}}
    steps:
      - uses: {CHECKOUT}
      - {{id: it, uses: ./, continue-on-error: true, with: {{text: fail}}}}
"""
    result = perform(workflow(jobs))
    assert result.jobs["a"].outputs == {"said": "fail failure"}
    assert result.conclusion == "success"


def test_an_action_in_an_action_fares_for_itself(perform: Perform, repository: Path) -> None:
    (repository / "inner").mkdir()
    inner = ECHO.replace(
        "    - id: say", "    - {shell: bash, run: 'echo ${{ env.NAME }} ${{ matrix.n }}'}\n    - id: say"
    )
    (repository / "inner/action.yml").write_text(inner, encoding="utf-8")
    (repository / "action.yml").write_text(
        "name: outer\noutputs: {said: {value: '${{ steps.inner.outputs.said }}'}}\n"
        "runs:\n  using: composite\n  steps:\n"
        "    - {shell: bash, run: exit 7}\n"
        "    - {id: inner, if: always(), uses: ./inner, with: {text: hello}}\n"
        "    - {shell: bash, run: echo not reached}\n",
        encoding="utf-8",
    )
    jobs = f"""
  a:
    runs-on: ubuntu-latest
    strategy: {{fail-fast: false, matrix: {{include: [{{n: 1}}]}}}}
    outputs: {{said: "${{{{ steps.outer.outputs.said }}}}"}}
    steps:
      - uses: {CHECKOUT}
      - {{uses: ./, id: outer, env: {{NAME: me}}}}
"""
    a = perform(workflow(jobs)).jobs["a"]
    assert (a.steps[1].exit_code, a.outputs) == (7, {"said": "hello"})
    assert a.runs[0].log.startswith("me 1\nhello by me")
    assert "not reached" not in a.runs[0].log


def test_own_actions_are_those_of_this_checkout(perform: Perform) -> None:
    jobs = (
        job("a", runs_on="x")
        .replace("ubuntu-latest\n    runs-on: x", "macos-15-intel")
        .replace("run: true", "uses: sim-action/sim-action@v0")
    )
    result = perform(workflow(jobs)).jobs["a"]
    assert result.result == "failure"
    assert "macOS X64" in result.annotations[0].message


@pytest.mark.parametrize(
    "uses", ["sim-action/sim-action@v2", "sim-action/sim-action/nothing@v0", "sim-action/other@v0"]
)
def test_actions_that_are_not_there_are_refused(perform: Perform, uses: str) -> None:
    with pytest.raises(UnsupportedFeature, match=uses):
        perform(workflow(job("a").replace("run: true", f"uses: {uses}")))


@pytest.mark.parametrize(
    ("label", "system"),
    [
        ("ubuntu-24.04", "Linux X64"),
        ("ubuntu-24.04-arm", "Linux ARM64"),
        ("macos-latest", "macOS ARM64"),
        ("macos-15", "macOS ARM64"),
        ("macos-15-intel", "macOS X64"),
        ("windows-latest", "Windows X64"),
        ("windows-2025", "Windows X64"),
    ],
)
def test_runners_have_a_system_and_an_architecture(perform: Perform, label: str, system: str) -> None:
    script = 'echo "$RUNNER_OS $RUNNER_ARCH ${{ runner.os }} ${{ runner.arch }}"\n        shell: bash'
    jobs = job("a", script).replace("ubuntu-latest", label)
    assert perform(workflow(jobs)).runs[0].log == f"{system} {system}\n"
