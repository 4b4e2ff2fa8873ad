"""The programs and tests of pages about Python and pytest, and the notebooks in examples/, run as they stand."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import interpreter, sim_action

ROOT = Path(__file__).parents[2]
README = "README.md"
PLUGIN = "plugins/pytest-sim-action"


def blocks(language: str, page: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


# The first one of the README is a controller, see test_documents.py.
_, *OF_README = blocks("python", README)
PRINTED = [
    "✓ travel at least 1.5 m: travelled 1.5 m in 2.00 s",
    "burger goes round the corner passed",
    "unknown key; did you mean 'model'?",
    "burger drives through a doorway: passed, ",
    "1.00 m/s at ",
    "at 1.0 m/s 1.5",
    "",
]
TESTS = {README: OF_README[1], PLUGIN: blocks("python", f"{PLUGIN}/README.md")[0]}


@pytest.mark.parametrize(
    ("program", "printed"), list(zip([*blocks("python", "docs/python.md"), OF_README[0]], PRINTED, strict=True))
)
def test_a_program_prints_what_it_should(
    program: str, printed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    if "mujoco" in program:
        pytest.importorskip("mujoco")
    for examples in ("turtlebot3", "gates"):
        shutil.copytree(ROOT / "examples" / examples, tmp_path / "examples" / examples)
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("program.py", run_name="__main__")
    out, errors = capfd.readouterr()
    assert errors == ""
    assert printed in out


@pytest.mark.parametrize("page", TESTS)
def test_a_test_of_a_page_passes(page: str, tmp_path: Path) -> None:
    (tmp_path / "test_robot.py").write_text(TESTS[page], encoding="utf-8")
    for name in ("straight_line.sim.yml", "drive_straight.sim.yml"):
        (tmp_path / name).write_text(blocks("yaml", README)[0], encoding="utf-8")
    # Without the settings of another folder, it is the root.
    (tmp_path / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    arguments = ("-p", "pytest_sim_action", "-p", "no:cacheprovider", "test_robot.py")
    path = os.pathsep.join(map(str, (ROOT, ROOT / PLUGIN)))
    ran = sim_action(tmp_path, *arguments, program="pytest", PYTHONPATH=path, PYTEST_DISABLE_PLUGIN_AUTOLOAD="1")
    assert "2 passed" in ran.stdout, ran.stdout + ran.stderr


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
    ran = interpreter(folder, "-c", EXECUTE, "--inplace", str(name), env=environment)
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
