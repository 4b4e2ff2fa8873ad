"""Matrices: the jobs that they stand for, and how those fare together."""

from __future__ import annotations

import pytest

from tests.integration.github import UnsupportedFeature
from tests.integration.github.conftest import Perform

JOBS = """on: push
jobs:
  plan:
    runs-on: ubuntu-latest
    outputs: {matrix: "${{ steps.plan.outputs.matrix }}"}
    steps:
      - id: plan
        env:
          FIRST: '{"index":1,"from":"first","scenario":"a b\\nc"}'
          SECOND: '{"index":2,"scenario":"${{ ''${{'' }} d }}"}'
        run: |
          echo "matrix={\\"include\\":[$FIRST,$SECOND]}" >> "$GITHUB_OUTPUT"
  shard:
    name: shard ${{ matrix.index }}
    needs: plan
    strategy: {fail-fast: false, matrix: "${{ fromJSON(needs.plan.outputs.matrix) }}"}
    runs-on: ubuntu-latest
    outputs: {from: "${{ matrix.from }}"}
    steps:
      - run: printf '<%s>' "$SCENARIO"
        env: {SCENARIO: "${{ matrix.scenario }}"}
"""


def test_a_matrix_can_come_from_another_job(perform: Perform) -> None:
    shard = perform(JOBS).jobs["shard"]
    assert [run.log for run in shard.runs] == ["<a b\nc>", "<${{ d }}>"]
    assert [run.name for run in shard.runs] == ["shard 1", "shard 2"]
    assert [run.matrix["index"] for run in shard.runs] == [1, 2]
    assert shard.outputs == {"from": "first"}


def matrix(strategy: str) -> str:
    steps = "[{run: 'test ${{ matrix.n }} -ne 2'}]"
    return f"on: push\njobs: {{a: {{runs-on: '${{{{ matrix.os }}}}', strategy: {strategy}, steps: {steps}}}}}"


def test_names_and_results_tell_combinations_apart(perform: Perform) -> None:
    jobs = ", ".join(f"{{os: ubuntu-latest, n: {n}}}" for n in (1, 2, 3))
    result = perform(matrix(f"{{fail-fast: false, matrix: {{include: [{jobs}]}}}}"))
    assert [run.name for run in result.runs] == [f"a (ubuntu-latest, {n})" for n in (1, 2, 3)]
    assert [run.result for run in result.runs] == ["success", "failure", "success"]
    assert result.jobs["a"].result == "failure"


@pytest.mark.parametrize(
    "strategy",
    [
        "{fail-fast: false, matrix: {include: []}}",
        "{fail-fast: false, matrix: {include: text}}",
        f"{{fail-fast: false, matrix: {{include: [{'{os: ubuntu-latest}, ' * 257}]}}}}",
        "{fail-fast: false, matrix: {os: [ubuntu-latest]}}",
        "{fail-fast: false, matrix: text}",
        "{matrix: {include: [{os: ubuntu-latest, n: 1}]}}",
        "{fail-fast: false, max-parallel: 1, matrix: {include: [{os: ubuntu-latest, n: 1}]}}",
    ],
)
def test_other_matrices_are_refused(perform: Perform, strategy: str) -> None:
    with pytest.raises(UnsupportedFeature):
        perform(matrix(strategy))
