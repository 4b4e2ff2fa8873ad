"""`run --watch` as people have it: a process that goes on, files that are saved, Ctrl-C."""

from __future__ import annotations

import json
import os
import queue
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.integration.conftest import write
from tests.patience import PATIENCE

SCENARIO = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {{twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 5 cm}}}}]
time_limit: 3 s
"""
FORBIDDEN = "expect: [{max_speed: {linear: 1 mm/s}}]"
WRITES = """\
from pathlib import Path

from sim_action import Twist

log = Path(__file__).with_name("run.log").open("a", buffering=1)


def control(observation):
    log.write("on\\n")
    return Twist((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process of its own here")


@contextmanager
def watching(folder: Path, *arguments: str, end: signal.Signals = signal.SIGINT) -> Iterator[Callable[[str], str]]:
    """What waits for a line with a text in it and returns all lines until then; a signal ends the process."""
    process = subprocess.Popen(
        [sys.executable, "-m", "sim_action", "run", "--watch", *arguments],
        cwd=folder,
        env={**os.environ, "GITHUB_ACTIONS": "", "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    lines = queue.Queue[str]()
    assert process.stdout is not None
    stream = process.stdout
    reader = threading.Thread(target=lambda: deque(map(lines.put, stream), maxlen=0), daemon=True)
    reader.start()

    def until(text: str) -> str:
        seen = ""
        while text not in seen:
            seen += lines.get(timeout=PATIENCE)
        return seen

    try:
        yield until
        process.send_signal(end)
        assert process.wait() == 130
    finally:
        process.kill()
        process.wait()
        reader.join()
        stream.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / ".git").mkdir()
    write(tmp_path / "a.sim.yml", SCENARIO.format(name="first"))
    write(tmp_path / "b.sim.yml", "extends: b.base.yml\nname: second\n")
    write(tmp_path / "b.base.yml", SCENARIO.format(name="base"))
    return tmp_path


def test_what_is_touched_runs_again_and_what_changed_is_told(folder: Path) -> None:
    with watching(folder) as until:
        assert "2 passed" in until("watching 3 files")
        base = SCENARIO.format(name="base").replace("expect: [{travel: {at_least: 5 cm}}]", FORBIDDEN)
        write(folder / "b.base.yml", base)
        told = until("watching 3 files")
        assert "changed: b.base.yml" in told
        assert "1 failed" in told
        assert re.search(r"newly fails +second", told)
        assert "first" not in told
        write(folder / "b.base.yml", SCENARIO.format(name="base"))
        assert re.search(r"fixed +second", until("watching 3 files"))


GATE = f"""\
{SCENARIO}variations: {{{{world.ground.friction: {{{{uniform: [0.4, 0.9]}}}}}}}}
gate: {{{{passes: {{{{at_least: 50 %}}}}, runs: 6}}}}
"""


def test_gates_are_compared_and_not_their_samples(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    gate = write(tmp_path / "a.sim.yml", GATE.format(name="often"))
    with watching(tmp_path) as until:
        until("watching 1 file")
        write(gate, GATE.format(name="often").replace("expect: [{travel: {at_least: 5 cm}}]", FORBIDDEN))
        told = until("watching 1 file")
        assert re.search(r"newly fails +often  a.sim.yml", told)
        assert "newly fails  often[" not in told


def test_a_new_scenario_is_run_and_one_that_is_gone_is_not(folder: Path) -> None:
    with watching(folder, ".", end=signal.SIGTERM) as until:
        until("watching 3 files")
        write(folder / "c.sim.yml", SCENARIO.format(name="third"))
        told = until("watching 4 files")
        assert re.search(r"new +third", told)
        assert "second" not in told
        (folder / "b.sim.yml").unlink()
        write(folder / "a.sim.yml", SCENARIO.format(name="first") + "tags: [quick]\n")
        until("changed: a.sim.yml")
        until("watching")


def test_a_file_that_is_broken_for_a_while_is_told_and_watched_on(folder: Path) -> None:
    with watching(folder, "a.sim.yml", "--output-dir", "out") as until:
        until("watching 1 file;")
        write(folder / "a.sim.yml", "name: [")
        assert "newly fails" in until("watching 1 file;")
        write(folder / "a.sim.yml", SCENARIO.format(name="first"))
        assert "1 passed" in until("watching 1 file;")
        results = json.loads((folder / "out/results.json").read_text(encoding="utf-8"))
        assert [outcome["status"] for outcome in results["outcomes"]] == ["passed"]


def test_what_the_runs_write_themselves_does_not_have_them_run_for_ever(folder: Path) -> None:
    write(folder / "log.py", WRITES)
    write(folder / "a.sim.yml", SCENARIO.format(name="run.log").replace("twist: [{linear: 1.0}]", "script: log.py"))
    with watching(folder, "a.sim.yml") as until:
        assert "run.log changes in every run and is no longer watched" in until("no longer watched")
        until("watching 2 files")
        write(folder / "log.py", f"{WRITES}\n")
        assert "changed: log.py\n" in until("watching 2 files")
