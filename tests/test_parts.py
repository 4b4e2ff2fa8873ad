"""The public names stand once, and the parts that a program can build are those that a file can name."""

from __future__ import annotations

import ast
from pathlib import Path

import sim_action
from sim_action import parts
from tools.docs.generators.scenario import parts_module


def test_editors_and_programs_see_the_same_names() -> None:
    tree = ast.parse(Path(sim_action.__file__).read_text(encoding="utf-8"))
    stated = {
        name.asname: node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for name in node.names
    }
    stated = {name: module for name, module in stated.items() if name is not None}
    assert stated == {name: sim_action._MODULES[name] for name in sim_action.__all__}


def test_every_part_of_a_file_has_its_class() -> None:
    assert Path(parts.__file__).read_text(encoding="utf-8") == parts_module()
