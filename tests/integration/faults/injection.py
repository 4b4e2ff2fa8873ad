"""Runs of the command line in which a fault is injected at the n-th call of a kind: see `injector.c`."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from tests.integration.marked_processes import processes_of
from tests.patience import PATIENCE

ROOT: Final = Path(__file__).parents[3]
COMPILER: Final = shutil.which("cc")
_SOURCE: Final = Path(__file__).parent / "injector.c"
_COUNTERS: Final = struct.Struct("@i3I")


@dataclass(frozen=True)
class Fault:
    """A fault, and the calls that may get it."""

    name: str  # the name of the fault; faults with the same name are one row of the table
    place: str  # a short name of the calls
    # "open" (everything that takes a descriptor), "create" (open for writing), "write" (also the length of a file),
    # "read", "rename", "mkdir", "sync", "fork" (everything that starts a process), "clock" (of the day), "monotonic"
    # (the clock of time limits)
    calls: str
    # patterns of absolute paths, separated by colons; {output}, {tmp} and {cache} are the folders of the run. Empty:
    # any path. A call without a path has the name of its kind, as "pipe".
    paths: str = ""
    # the process that makes the call: the command itself, or one below it. Empty: any.
    role: Literal["", "parent", "child"] = ""
    lasting: bool = False  # all calls from the n-th on get the fault, as on a disk that stays full
    error: int = 0  # the errno that the call returns
    signal: int = 0  # the signal that is sent at the call
    # the process that gets the signal: the command itself, or the process that makes the call
    target: Literal["", "parent", "self"] = ""
    jump: int = 0  # s that the clock jumps
    most_lost: int = 0  # the number of scenarios that may end without a verdict
    exempt: tuple[str, ...] = ()  # names of scenarios that may also end without a verdict
    suite: str = ""  # the suite that runs; empty: one for odd n, and the other for even n
    short: tuple[int, ...] = (1,)  # the n that are tried in the short form
    stride: int = 1  # the long form tries every n-th call, up to the last one

    def __str__(self) -> str:
        return f"{self.name}: {self.place}"


@dataclass(frozen=True)
class Run:
    """A finished run, and the traces that it left."""

    folder: Path
    code: int  # the exit code; negative: the signal that ended the command
    printed: str
    errors: str
    reached: int  # the calls that could have got the fault
    fired: int  # those that got it
    left: tuple[int, ...]  # numbers of processes that are still there

    @property
    def output(self) -> Path:
        return self.folder / "suite" / "sim-results"

    @property
    def tmp(self) -> Path:
        return self.folder / "tmp"


def compiled(folder: Path) -> Path:
    """Compile the library, unless the folder has it, and return its path."""
    library = folder / "injector.so"
    if not library.exists():
        options = ["-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC"]
        subprocess.run([str(COMPILER), *options, "-o", str(library), str(_SOURCE), "-ldl"], check=True)
    return library


def run_suite(folder: Path, cache: Path, library: Path | None = None, fault: Fault | None = None, nth: int = 1) -> Run:
    """Run the suite in `folder`/suite, with a fault at its n-th call."""
    (folder / "tmp").mkdir()
    counters = folder / "counters"
    counters.write_bytes(bytes(_COUNTERS.size))
    settings = {} if fault is None else _settings(fault, nth, folder, cache)
    injected = {} if library is None else {"LD_PRELOAD": str(library), "ROS_FAULT_COUNTERS": str(counters)}
    variables = {**injected, **settings, "ROS_MARK": str(folder), "TMPDIR": str(folder / "tmp")}
    run = sim_action(folder / "suite", cache, variables, "run", ".", "--jobs", "2")
    left = _left(folder, run.returncode)
    _, _, reached, fired = _COUNTERS.unpack(counters.read_bytes())
    return Run(folder, run.returncode, run.stdout, run.stderr, reached, fired, left)


def sim_action(folder: Path, cache: Path, variables: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command line in a folder, in an interpreter of its own."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("GITHUB_", "SIM_ACTION_"))}
    return subprocess.run(
        [sys.executable, "-m", "sim_action", *words],
        cwd=folder,
        env={**kept, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(cache), **variables},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
        start_new_session=True,
    )


def _settings(fault: Fault, nth: int, folder: Path, cache: Path) -> dict[str, str]:
    places = {"output": folder / "suite/sim-results", "tmp": folder / "tmp", "cache": cache, "suite": folder / "suite"}
    return {
        "ROS_FAULT_CALLS": fault.calls,
        "ROS_FAULT_PATHS": fault.paths.format(**places),
        "ROS_FAULT_ROLE": fault.role,
        # Earlier calls are those of a Python that starts: sim-action is not there yet.
        "ROS_FAULT_AFTER": "*.sim.yml",
        "ROS_FAULT_FIRST": str(nth),
        "ROS_FAULT_TIMES": "0" if fault.lasting else "1",
        "ROS_FAULT_ERROR": str(fault.error),
        "ROS_FAULT_SIGNAL": str(fault.signal),
        "ROS_FAULT_TARGET": fault.target,
        "ROS_FAULT_JUMP": str(fault.jump),
    }


def _left(folder: Path, code: int) -> tuple[int, ...]:
    """Return the processes that are left. A command that was killed cannot wait until the last one has ended."""
    deadline = time.monotonic() + (PATIENCE if code == -signal.SIGKILL else 0.0)
    while (left := processes_of(folder)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return tuple(left)
