"""The programs and tests of pages about Python and pytest run as they stand."""

from __future__ import annotations

import os
import re
import runpy
import shutil
from pathlib import Path

import pytest

from tests.integration.conftest import sim_action

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
