"""The files that user code reads, as the audit hook of the child process notes them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.networks.network_check import CHECK
from sim_action.runner import observed_inputs as module
from sim_action.runner.job import Job
from sim_action.runner.observed_inputs import MAX_INPUTS, ObservedInputs, inputs_in, observed_inputs
from tests.scenarios import LEAST, load

TRUNCATES = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
APPENDS = os.O_WRONLY | os.O_CREAT | os.O_APPEND


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObservedInputs:
    """Those of a scenario in a workspace, whose scratch folder and results lie elsewhere."""
    workspace = tmp_path / "workspace"
    workspace.mkdir()
    monkeypatch.chdir(workspace)
    job = Job(load(workspace, LEAST), tmp_path / "results/traces/a.npz", tmp_path / "results")
    return ObservedInputs(job, tmp_path / "scratch")


@pytest.mark.parametrize(
    ("event", "arguments", "name"),
    [
        ("open", ("a.txt", "r", os.O_RDONLY), "workspace/a.txt"),
        ("open", (b"a.txt", "r", os.O_RDONLY), "workspace/a.txt"),
        ("open", (Path("b/../a.txt"), None, os.O_RDWR), "workspace/a.txt"),
        ("open", ("../secret", "r", os.O_RDONLY), "secret"),
        ("open", ("../secret", "w", TRUNCATES), "secret"),
        ("open", ("../secret", "a", APPENDS), "secret"),
        ("open", ("__pycache__/a.cpython-311.pyc", "rb", os.O_RDONLY), "workspace/a.py"),
        ("open", ("a.pyc", "rb", os.O_RDONLY), "workspace/a.pyc"),
        ("open", ("../results/results.json", "r", os.O_RDONLY), "results/results.json"),
        ("sqlite3.connect", ("a.db",), "workspace/a.db"),
        ("os.listdir", ("..",), ""),
        ("os.scandir", ("../results2",), "results2"),
        ("ctypes.dlopen", ("libm.so.6",), "workspace/libm.so.6"),
    ],
)
def test_inputs_are_noted(
    inputs: ObservedInputs, tmp_path: Path, event: str, arguments: tuple[Any, ...], name: str
) -> None:
    inputs.take(event, arguments)
    assert inputs.files == (os.path.normpath(tmp_path / name),)


@pytest.mark.parametrize(
    ("event", "arguments"),
    [
        ("open", ("a.txt", "w", TRUNCATES)),
        ("open", ("a.txt", "a", APPENDS)),
        ("open", ("../results/traces/a.npz", "w", TRUNCATES)),
        ("open", ("../scratch/a", "r", os.O_RDONLY)),
        ("open", ("../scratch", None, os.O_RDWR | os.O_EXCL)),
        ("open", (3, "r", os.O_RDONLY)),
        ("open", (os.__file__, "r", os.O_RDONLY)),
        ("open", (pytest.__file__, "r", os.O_RDONLY)),
        ("open", (module.__file__, "r", os.O_RDONLY)),
        ("open", ("/dev/urandom", "rb", os.O_RDONLY)),
        ("open", ("/proc/self/status", "r", os.O_RDONLY)),
        ("os.listdir", (".",)),
        ("os.listdir", (None,)),
        ("os.scandir", ("folder",)),
        ("os.listdir", (sysconfig.get_paths()["stdlib"],)),
        ("ctypes.dlopen", (None,)),
        ("import", ("a", None, None, None, None)),
        ("exec", ("a",)),
    ],
)
def test_own_files_and_those_of_python_are_not(inputs: ObservedInputs, event: str, arguments: tuple[Any, ...]) -> None:
    inputs.take(event, arguments)
    assert inputs.files == ()


def test_a_file_that_the_code_has_written_is_no_input(inputs: ObservedInputs) -> None:
    inputs.take("open", ("a.txt", "w", TRUNCATES))
    inputs.take("open", ("a.txt", "r", os.O_RDONLY))
    assert inputs.files == ()
    inputs.take("open", ("b.txt", "a", APPENDS))
    inputs.take("open", ("b.txt", "r", os.O_RDONLY))
    assert len(inputs.files or ()) == 1


@pytest.mark.parametrize("event", ["subprocess.Popen", "os.system", "os.fork", "os.posix_spawn", "socket.__new__"])
def test_processes_and_sockets_may_read_anything(inputs: ObservedInputs, event: str) -> None:
    inputs.take(event, ())
    assert inputs.files is None
    assert inputs_in(inputs.encoded()) is None


def test_the_check_of_a_network_reads_no_other_file(inputs: ObservedInputs) -> None:
    inputs.take("subprocess.Popen", (CHECK[0], list(CHECK), None, {}))
    assert inputs.files == ()
    inputs.take("subprocess.Popen", (CHECK[0], [*CHECK, "more"], None, {}))
    assert inputs.files is None


def test_each_file_is_noted_once_and_the_number_is_limited(inputs: ObservedInputs) -> None:
    for number in range(MAX_INPUTS):
        inputs.take("open", (str(number), "r", os.O_RDONLY))
        inputs.take("open", (str(number), "r", os.O_RDONLY))
    assert len(inputs.files or ()) == MAX_INPUTS
    inputs.take("open", ("one more", "r", os.O_RDONLY))
    assert inputs.files is None


def test_only_user_code_is_observed(tmp_path: Path) -> None:
    job = Job(load(tmp_path, LEAST), tmp_path / "a.npz", tmp_path)
    assert observed_inputs(job, tmp_path) is None


def test_the_report_is_read_back(inputs: ObservedInputs, tmp_path: Path) -> None:
    inputs.take("open", (os.fsencode("\udcff"), "r", os.O_RDONLY))
    assert inputs_in(inputs.encoded()) == (str(tmp_path / "workspace" / "\udcff"),)


def test_code_that_replaces_json_loses_no_verdict(
    inputs: ObservedInputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inputs.take("open", ("é.txt", "r", os.O_RDONLY))
    with monkeypatch.context() as patch:
        patch.setattr(json.JSONEncoder, "encode", None)
        patch.delattr(json, "dumps")
        written = inputs.encoded()
    assert inputs_in(written) == (str(tmp_path / "workspace" / "é.txt"),)


@given(st.lists(st.text() | st.integers(), max_size=5))
def test_a_report_is_a_list_of_paths(report: list[str | int]) -> None:
    is_valid = all(isinstance(each, str) for each in report)
    assert inputs_in(json.dumps(report).encode()) == (tuple(report) if is_valid else None)


@pytest.mark.parametrize("report", [b"", b"null", b"[1]", b"{}", b"[" * 100_000, json.dumps(["a"] * 2001).encode()])
def test_such_a_report_may_mean_anything(report: bytes) -> None:
    assert inputs_in(report) is None


HEARS = """
import os, sys
from pathlib import Path
from sim_action.runner import observed_inputs as module

heard = []
class Receiver:
    def take(self, event, arguments):
        if event == "os.listdir":
            raise ValueError(event)
        heard.append(event)

receiver = Receiver()
module.ObservedInputs = lambda job, scratch: receiver
class Job:
    class loaded:
        class scenario:
            runs_user_code = True
module.observed_inputs(Job, Path())
heard.clear()
open(os.devnull).close()
os.system("true")
print(*heard)
heard.clear()
os.listdir(".")
print(*heard)
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="a program of Unix")
def test_the_hook_hears_python_and_hides_its_own_faults() -> None:
    ran = subprocess.run([sys.executable, "-c", HEARS], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["open os.system", "os.fork"]
