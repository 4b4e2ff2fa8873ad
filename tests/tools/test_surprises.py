"""The table of docs/engines/surprises.md names scripts and tests that exist."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from tools.docs.generators.surprises import Surprise, surprises

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("row", surprises(), ids=lambda row: row.surprise[:40])
def test_a_row_has_a_source_and_a_test_that_exists(row: Surprise) -> None:
    assert row.does in {"right", "note", "refused", "unused"}
    assert bool(row.script) != bool(row.source)
    assert row.test or row.does == "unused"
    if row.test:
        file, _, name = row.test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^ *def {name}\(", text, re.MULTILINE) if name else "def test_" in text


def test_every_finding_is_in_the_table_once() -> None:
    scripts = Counter(row.script for row in surprises() if row.script)
    assert scripts == Counter(path.stem for path in (ROOT / "findings").glob("*.sh"))
