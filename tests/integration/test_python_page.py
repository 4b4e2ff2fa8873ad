"""The programs of the page about Python run as they stand."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAMS = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(encoding="utf-8"), re.DOTALL)
PRINTED = [
    "✓ travel at least 1.5 m: travelled 1.5 m in 2.00 s",
    "burger goes round the corner passed",
    "unknown key; did you mean 'model'?",
    "1.00 m/s at ",
    "at 1.0 m/s 1.5",
]


@pytest.mark.parametrize(("program", "printed"), list(zip(PROGRAMS, PRINTED, strict=True)))
def test_a_program_of_the_page_prints_what_it_should(program: str, printed: str, tmp_path: Path) -> None:
    if "mujoco" in program:
        pytest.importorskip("mujoco")
    shutil.copytree(ROOT / "examples/turtlebot3", tmp_path / "examples/turtlebot3")
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "PYTHONIOENCODING": "utf-8"}
    ran = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stderr) == (0, "")
    assert printed in ran.stdout
