"""The notebooks in examples/ run from the first cell to the last one, and show what they should."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted(path.relative_to(ROOT) for path in (ROOT / "examples").rglob("*.ipynb"))
EXECUTE = "from nbclient.cli import main; main()"
KERNEL = {
    "argv": [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
    "display_name": "Python 3",
    "language": "python",
}


def cells(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in found if cell["cell_type"] == "code"]


def executed(name: Path, folder: Path) -> list[dict[str, Any]]:
    """The cells of a notebook after a run with this Python, and with nothing of the user's."""
    shutil.copytree(ROOT / "examples", folder / "examples")
    (folder / "data/kernels/python3").mkdir(parents=True)
    (folder / "data/kernels/python3/kernel.json").write_text(json.dumps(KERNEL))
    own = {name: str(folder / "own") for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR")}
    environment = {**os.environ, **own, "JUPYTER_DATA_DIR": str(folder / "data"), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", EXECUTE, "--inplace", str(name)]
    ran = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return cells(folder / name)


def shown(cell: dict[str, Any]) -> str:
    (output,) = cell["outputs"]
    return "".join(output["text"] if output["output_type"] == "stream" else output["data"]["text/html"])


@pytest.mark.parametrize("name", NOTEBOOKS, ids=str)
def test_no_output_is_stored(name: Path) -> None:
    assert [(cell["outputs"], cell["execution_count"]) for cell in cells(ROOT / name)] == [([], None)] * len(
        cells(ROOT / name)
    )


def test_there_is_one() -> None:
    assert [path.as_posix() for path in NOTEBOOKS] == ["examples/notebook/sweep.ipynb"]


def test_a_sweep_shows_verdicts_numbers_and_reports(tmp_path: Path) -> None:
    one, numbers, sweep, failed, report = map(shown, executed(NOTEBOOKS[0], tmp_path))
    assert "travel at least 1.5 m" in one
    assert "<iframe" in one
    assert "at 0.95 m/s after 1." in numbers
    assert [line.split()[3:4] for line in sweep.splitlines()] == [["failed"], ["passed"], ["passed"], ["passed"]]
    assert "at 0.04 m/s" in failed
    assert "at 0.25 m/s" not in failed
    assert all(f"at {speed} m/s" in report.partition("<iframe")[0] for speed in (0.04, 0.25, 0.5, 1.0))
