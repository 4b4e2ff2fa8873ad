"""The start of nodes: seeded generators, and other code that runs at the start of Python."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sim_action.ros import node_start
from tests.patience import PATIENCE

pytestmark = pytest.mark.process

DRAWS = """\
import random
import numpy
print(random.random(), numpy.random.rand(), numpy.random.default_rng().random(), numpy.random.default_rng().random())
print(numpy.random.default_rng(1).random(), list({"a", "b", "c", "d"}))
"""


def drawn(folder: Path, seed: int, *words: str) -> list[str]:
    """What a program draws that starts with this code, after another sitecustomize."""
    start, others = folder / "start", folder / "others"
    if not start.exists():
        start.mkdir()
        others.mkdir()
        (start / "sitecustomize.py").symlink_to(node_start.__file__)
        (others / "sitecustomize.py").write_text("print('others')\n")
        (folder / "draws.py").write_text(DRAWS)
    variables = {**os.environ, **node_start.variables(seed), "PYTHONPATH": f"{start}{os.pathsep}{others}"}
    command = [sys.executable, str(folder / "draws.py"), *words]
    return subprocess.run(command, env=variables, capture_output=True, text=True, check=True).stdout.splitlines()


def test_generators_start_from_the_seed_and_the_name_of_the_node(tmp_path: Path) -> None:
    first, again = drawn(tmp_path, 3, "__node:=a", "/tmp/x1"), drawn(tmp_path, 3, "__node:=a", "/tmp/x2")
    other_node, other_seed = drawn(tmp_path, 3, "__node:=b"), drawn(tmp_path, 4, "__node:=a")
    assert first == again
    assert first[0] == "others"
    draws = [line[1].split() for line in (first, other_node, other_seed)]
    assert len({number for line in draws for number in line}) == 12
    assert first[2].split()[0] == other_node[2].split()[0] == other_seed[2].split()[0]


@contextmanager
def in_another_thread(act: object) -> Iterator[threading.Thread]:
    thread = threading.Thread(target=act)  # type: ignore[arg-type]  # a function
    thread.start()
    try:
        yield thread
    finally:
        thread.join(PATIENCE)


@pytest.mark.skipif(sys.platform != "linux", reason="threads are named by /proc")
def test_a_loop_goes_on_when_the_executor_has_handled_all() -> None:
    turns, slept, order, names = node_start._Turns(), threading.Event(), list[str](), list[str]()
    sleep = turns.ordered(lambda: slept.wait(PATIENCE))

    def loop() -> None:
        for _ in range(2):
            sleep()
            order.append("loop")
            names.append(Path(f"/proc/self/task/{threading.get_native_id()}/comm").read_text().strip())

    with in_another_thread(loop) as thread:
        turns.handle()
        slept.set()
        thread.join(0.05)  # it may go on within this time, and must not
        order.append("executor")
        turns.wait()
    assert order == ["executor", "loop", "loop"]
    assert names == [node_start.ORDERED] * 2
    assert not turns.must_look()


@pytest.mark.skipif(sys.platform != "linux", reason="threads are named by /proc")
def test_a_loop_next_to_which_messages_are_handled_is_not_ordered() -> None:
    turns = node_start._Turns()
    turns.ordered(lambda: None)()
    with in_another_thread(turns.handle):
        pass
    with pytest.raises(ZeroDivisionError):
        turns.ordered(lambda: 1 // 0)()
    task = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
    assert task.read_text().strip() == "unordered"
