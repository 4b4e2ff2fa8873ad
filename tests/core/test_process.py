from __future__ import annotations

import subprocess
import sys

import pytest

MAKING = """
import gc
{before}
told = gc.get_stats()[0]["collections"]
made = [[] for _ in range(100_000)]
print(gc.get_stats()[0]["collections"] - told)
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("before", "is_looking"),
    [("", True), ("from sim_action.core.process import collect_garbage_rarely\ncollect_garbage_rarely()", False)],
)
def test_what_is_made_is_not_looked_through(before: str, is_looking: bool) -> None:
    code = MAKING.format(before=before)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (int(ran.stdout) > 0) == is_looking
