"""Tables of names: every entry loads, in order, and only when asked."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.commands import COMMANDS, CommandSource
from sim_action.core.registry import Table
from sim_action.drives import DRIVES, Drive

COLOURS = Table[type]("colour", {"red": "fractions:Fraction", "green": "decimal:Decimal"})


def test_an_unknown_name_is_a_key_error() -> None:
    with pytest.raises(KeyError, match="blue"):
        COLOURS.load("blue")


@pytest.mark.parametrize(("table", "base"), [(ASSERTIONS, Assertion), (COMMANDS, CommandSource), (DRIVES, Drive)])
def test_every_part_is_of_its_base_and_knows_its_key(table: Table[Any], base: type) -> None:
    for name in table:
        part = table.load(name)
        assert issubclass(part, base)
        assert part.key == name
        assert table is not COMMANDS or name in {field.alias or key for key, field in part.model_fields.items()}


@pytest.mark.process
def test_loading_a_scenario_imports_neither_numpy_nor_an_engine() -> None:
    code = "import sys, sim_action.scenario.loading; print([m for m in ('numpy', 'pybullet') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.process
def test_no_assertion_needs_numpy_before_it_is_watched() -> None:
    code = (
        "import sys\nfrom sim_action.assertions import ASSERTIONS\n"
        "loaded = [name for name in ASSERTIONS if ASSERTIONS.load(name) and 'numpy' in sys.modules]\n"
        "print('none' if not loaded else f'from {loaded[0]} on')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "none"
