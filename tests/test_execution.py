"""File names for traces; what runs is tested in integration/test_execution.py."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from sim_action.execution import trace_paths


def test_a_name_becomes_a_plain_file_name() -> None:
    (path,) = trace_paths(["burger: 1.5 m / 30 s"], Path("out"))
    assert path == Path("out/traces/burger-1.5-m-30-s.npz")


@given(st.lists(st.text(max_size=200), max_size=10))
def test_paths_stay_in_the_folder_and_differ_whatever_the_case(names: list[str]) -> None:
    paths = trace_paths(names, Path("out"))
    assert all(path.parent == Path("out/traces") and path.suffix == ".npz" for path in paths)
    assert len({str(path).lower() for path in paths}) == len(names)
    assert all(len(path.name.encode()) < 120 for path in paths)
