"""The start of nodes: seeded generators, and other code that runs at the start of Python."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.ros import node_start

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
