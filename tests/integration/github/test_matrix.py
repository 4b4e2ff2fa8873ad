"""Matrices: the jobs that they stand for, and how those fare together."""

from __future__ import annotations

import pytest

from tests.integration.github import UnsupportedFeature
from tests.integration.github.conftest import Perform
from tests.integration.github.matrix import combinations
from tests.integration.github.values import Value

JOBS = """on: push
jobs:
  plan:
    runs-on: ubuntu-latest
    outputs: {matrix: "${{ steps.plan.outputs.matrix }}"}
    steps:
      - id: plan
        env: {FIRST: '{"index":1,"scenario":"a b\\nc"}', SECOND: '{"index":2,"scenario":"${{ ''${{'' }} d }}"}'}
        run: |
          echo "matrix={\\"include\\":[$FIRST,$SECOND]}" >> "$GITHUB_OUTPUT"
  shard:
    name: shard ${{ matrix.index }}
    needs: plan
    strategy: {fail-fast: false, matrix: "${{ fromJSON(needs.plan.outputs.matrix) }}"}
    runs-on: ubuntu-latest
    outputs: {from: "${{ matrix.index == 1 && 'first' || '' }}"}
    steps:
      - run: printf '<%s>' "$SCENARIO" "$PLACE"
        env: {SCENARIO: "${{ matrix.scenario }}", PLACE: "${{ strategy.job-index }}/${{ strategy.job-total }}"}
"""


@pytest.mark.parametrize(
    ("matrix", "jobs"),
    [
        ({"a": [1, 2], "b": ["x"]}, [{"a": 1, "b": "x"}, {"a": 2, "b": "x"}]),
        ({"include": [{"a": 1}, {"a": 2, "b": 3}]}, [{"a": 1}, {"a": 2, "b": 3}]),
        (
            {"a": [1, 2], "include": [{"c": 5}, {"a": 1, "b": 6}, {"a": 3}, {"c": 7}]},
            [{"a": 1, "c": 7, "b": 6}, {"a": 2, "c": 7}, {"a": 3}],
        ),
    ],
)
def test_combinations(matrix: Value, jobs: list[Value]) -> None:
    assert combinations(matrix) == jobs


@pytest.mark.parametrize(
    "matrix",
    [{"include": []}, {"a": []}, {}, {"a": "text"}, {"exclude": [], "a": [1]}, {"a": list(range(257))}, "text"],
)
def test_no_combinations(matrix: Value) -> None:
    with pytest.raises(UnsupportedFeature):
        combinations(matrix)


def test_a_matrix_can_come_from_another_job(perform: Perform) -> None:
    shard = perform(JOBS).jobs["shard"]
    assert [run.log for run in shard.runs] == ["<a b\nc><0/2>", "<${{ d }}><1/2>"]
    assert [run.name for run in shard.runs] == ["shard 1", "shard 2"]
    assert [run.matrix["index"] for run in shard.runs] == [1, 2]
    assert shard.outputs == {"from": "first"}


def test_names_tell_combinations_apart(perform: Perform) -> None:
    matrix = "{os: [ubuntu-latest], n: [1, 2]}"
    text = f"on: push\njobs: {{a: {{runs-on: '${{{{ matrix.os }}}}', strategy: {{matrix: {matrix}}}, steps: []}}}}"
    result = perform(text)
    assert [run.name for run in result.runs] == ["a (ubuntu-latest, 1)", "a (ubuntu-latest, 2)"]
    assert result.jobs["a"].result == "success"


@pytest.mark.parametrize(
    ("keys", "results", "joined"),
    [
        ("", ["success", "failure", "cancelled"], "failure"),
        ("fail-fast: false, ", ["success", "failure", "success"], "failure"),
        ("fail-fast: '${{ false }}', ", ["success", "failure", "success"], "failure"),
    ],
)
def test_failing_fast(perform: Perform, keys: str, results: list[str], joined: str) -> None:
    text = f"""on: push
jobs:
  a:
    runs-on: ubuntu-latest
    strategy: {{{keys}matrix: {{n: [1, 2, 3]}}}}
    steps:
      - run: test ${{{{ matrix.n }}}} -ne 2
"""
    a = perform(text).jobs["a"]
    assert [run.result for run in a.runs] == results
    assert a.result == joined


def test_a_forgiven_failure_cancels_nobody(perform: Perform) -> None:
    text = """on: push
jobs:
  a:
    runs-on: ubuntu-latest
    continue-on-error: ${{ matrix.n == 1 }}
    strategy: {matrix: {n: [1, 2]}}
    steps:
      - run: test ${{ matrix.n }} -ne 1
"""
    a = perform(text).jobs["a"]
    assert [run.result for run in a.runs] == ["failure", "success"]
    assert a.result == "success"
