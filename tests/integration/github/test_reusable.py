"""Workflows that others call."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.github import UnsupportedFeature
from tests.integration.github.conftest import Perform

CALLED = """
name: called
on:
  workflow_call:
    inputs:
      text: {type: string, default: "by ${{ github.event_name }}"}
      none: {type: string}
    outputs:
      said: {description: what, value: "${{ jobs.say.outputs.said }}"}
      none: {value: "${{ jobs.never.outputs.said }}"}
permissions: {contents: read}
jobs:
  say:
    name: say it
    runs-on: ubuntu-latest
    outputs: {said: "${{ steps.say.outputs.said }}"}
    steps:
      - id: say
        env:
          TEXT: ${{ inputs.text }}${{ inputs.none }}
        run: |
          echo "said=hello $TEXT" >> "$GITHUB_OUTPUT"
          echo "$GITHUB_WORKFLOW"
          [[ "$TEXT" != fail* ]]
        shell: bash
  never:
    if: ${{ inputs.none != '' }}
    runs-on: ubuntu-latest
    steps: [{run: "true"}]
"""


def caller(more: str = "", permissions: str = "contents: read") -> str:
    return f"""
name: caller
on: push
permissions: {{{permissions}}}
jobs:
  call:
    uses: ./.github/workflows/called.yml
{more}
  after:
    needs: call
    if: ${{{{ always() }}}}
    runs-on: ubuntu-latest
    steps:
      - run: echo "${{{{ needs.call.result }}}} ${{{{ needs.call.outputs.said }}}}${{{{ needs.call.outputs.none }}}}"
"""


@pytest.fixture
def called(repository: Path) -> Path:
    file = repository / ".github/workflows/called.yml"
    file.write_text(CALLED, encoding="utf-8")
    return file


@pytest.mark.usefixtures("called")
def test_inputs_go_in_and_outputs_come_out(perform: Perform) -> None:
    result = perform(caller("    with: {text: 'it''s ${{ github.ref_name }}'}"))
    assert result.jobs["after"].runs[0].log == "success hello it's main\n"
    assert [run.name for run in result.jobs["call"].runs] == ["call / say it", "call / never"]
    assert result.jobs["call"].runs[0].log == "caller\n"


@pytest.mark.usefixtures("called")
def test_inputs_have_defaults(perform: Perform) -> None:
    assert perform(caller()).jobs["after"].runs[0].log == "success hello by push\n"


@pytest.mark.usefixtures("called")
def test_a_failure_comes_out_with_its_outputs(perform: Perform) -> None:
    result = perform(caller("    with: {text: fail}"))
    assert result.jobs["after"].runs[0].log == "failure hello fail\n"
    assert result.conclusion == "failure"


@pytest.mark.usefixtures("called")
@pytest.mark.parametrize(
    "more",
    [
        "    with: {typo: 1}",
        "    with: {text: 1}",
        "    with: {text: '${{ true }}'}",
        "    strategy: {fail-fast: false, matrix: {include: [{n: 1}]}}",
        "    with: {text: '${{ env.PATH }}'}",
        "    runs-on: ubuntu-latest",
        "    permissions: {}",
    ],
)
def test_calls_that_github_would_not_take_are_refused(perform: Perform, more: str) -> None:
    with pytest.raises(UnsupportedFeature):
        perform(caller(more))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("on:\n  workflow_call:", "on:\n  push:"),
        ("text: {type: string,", "text: {typo: true, type: string,"),
        ("none: {type: string}", "none: {type: number}"),
        ("none: {type: string}", "none: {type: string, required: true}"),
        ("jobs.say.outputs", "jobs.sya.outputs"),
        ("{contents: read}", "{contents: read, checks: write}"),
    ],
)
def test_callees_that_github_would_not_take_are_refused(perform: Perform, called: Path, old: str, new: str) -> None:
    assert old in CALLED
    called.write_text(CALLED.replace(old, new), encoding="utf-8")
    with pytest.raises(UnsupportedFeature):
        perform(caller())


def test_a_callee_has_what_its_caller_grants(perform: Perform, called: Path) -> None:
    called.write_text(CALLED.replace("{contents: read}", "{contents: read, checks: write}"), encoding="utf-8")
    assert perform(caller(permissions="contents: read, checks: write")).conclusion == "success"
