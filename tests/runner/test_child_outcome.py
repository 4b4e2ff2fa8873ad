"""What a child's end is said to be, where no child of this machine can end so."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import pytest

from sim_action.runner.child_outcome import outcome_of
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.job import Job
from sim_action.scenario.loading import load_scenario

SCENARIO = "name: n\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"


class Gone(ChildProcess):
    """One of Windows, which is over."""

    forks = False
    limits_memory = False

    @classmethod
    def start(cls, job: Job) -> Self:
        return cls(job, -1)

    def poll(self) -> int | None:
        return None

    def kill(self) -> None: ...

    def close(self) -> None: ...

    def _heard(self) -> bytes:
        return b""


@pytest.mark.parametrize(
    ("code", "title", "cause"),
    [
        (0xC0000005, "STATUS_ACCESS_VIOLATION", ": native code crashed"),
        (0xC00000FD, "STATUS_STACK_OVERFLOW", ": native code crashed"),
        (3, "exit 3", "ended by itself, with exit code 3"),
    ],
)
def test_what_windows_ends_is_told_from_what_ends_itself(tmp_path: Path, code: int, title: str, cause: str) -> None:
    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    job = Job(load_scenario(tmp_path / "a.sim.yml"), tmp_path / "t.npz", tmp_path, tmp_path, memory_is_limited=False)
    (failure,) = outcome_of(Gone.start(job), code).failures
    assert (failure.kind, failure.title) == ("crash", title)
    assert cause in failure.message


def test_memory_that_is_not_limited_is_not_said_to_be(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    job = Job(load_scenario(tmp_path / "a.sim.yml"), tmp_path / "t.npz", tmp_path, tmp_path, memory_is_limited=False)
    job.output_file.write_text("terminate called after throwing an instance of 'std::bad_alloc'\n")
    (failure,) = outcome_of(Gone.start(job), -6).failures
    assert failure.kind == "memory"
    assert "it needs more memory than this machine has" in failure.message
