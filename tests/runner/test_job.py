"""Jobs: each is made when it is asked for."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import Mock

import pytest

from sim_action.runner.job import Job, JobList


def job(index: int) -> Job:
    return Job(Mock(), Path("/out/traces") / f"{index}.npz", Path("/out"))


def test_a_list_makes_the_jobs_that_are_asked_for() -> None:
    made = Mock(side_effect=job)
    jobs = JobList(made, 10_000)
    assert len(jobs) == 10_000
    assert not made.called
    assert jobs[7].trace == Path("/out/traces/7.npz")
    assert [each.trace.stem for each in jobs[2:4]] == ["2", "3"]
    assert jobs[-1].trace.stem == "9999"
    with pytest.raises(IndexError):
        _ = jobs[10_000]


@pytest.mark.parametrize(
    ("path", "name"), [("/out/traces/a.npz", "traces/a.npz"), ("/elsewhere/a.npz", "../elsewhere/a.npz")]
)
def test_a_file_is_named_from_the_folder_of_the_results(path: str, name: str) -> None:
    assert Job(Mock(), Path(path), Path("/out")).trace_name == name
