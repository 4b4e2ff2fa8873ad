"""A fault of sim-action's own, in a check of one scenario: it is told as one, and costs the others nothing."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

import pytest

from sim_action.results.results_json import Results
from tests.integration.conftest import interpreter
from tests.scenarios import LEAST

ROOT: Final = Path(__file__).parents[2]

# An assertion whose check is at fault, in the table as a contributor would put it there.
FAULTY: Final = """
import sys
from typing import ClassVar

from sim_action.assertions import ASSERTIONS
from sim_action.assertions.upright import Upright
from sim_action.cli.main import call


class Faulty(Upright):
    key: ClassVar[str] = "faulty"

    def problems(self, scene):
        yield {}["nowhere"]


if __name__ == "__main__":
    ASSERTIONS.paths["faulty"] = "faulty:Faulty"
    sys.exit(call(sys.argv[1:]))
"""
SAID: Final = "an internal error of sim-action: KeyError: 'nowhere'; please report it"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "faulty.py").write_text(FAULTY)
    for name, expected in (("a", "upright"), ("b", "faulty"), ("c", "upright: {max_tilt: 1 m}")):
        text = LEAST.replace("travel: {at_least: 1.5 m}", expected).replace("30 s", "0.1 s")
        (tmp_path / f"{name}.sim.yml").write_text(text)
    return tmp_path


def called(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return interpreter(folder, "faulty.py", *arguments, env={"PYTHONPATH": str(ROOT)})


def test_it_is_an_error_of_that_scenario_and_the_others_run(folder: Path) -> None:
    assert called(folder, "run").returncode == 3
    results = Results.read(folder / "sim-results" / "results.json")
    passed, faulty, invalid = results.outcomes
    assert [outcome.status for outcome in results.outcomes] == ["passed", "error", "error"]
    assert (passed.exit_code, faulty.exit_code, invalid.exit_code) == (0, 3, 2)
    (failure,) = faulty.failures
    assert (faulty.name, faulty.file) == ("burger drives straight", "b.sim.yml")
    assert (failure.kind, failure.title, failure.message) == ("internal", "internal error", SAID)
    assert failure.details.startswith("Traceback (most recent call last):\n")
    assert "in problems\n" in failure.details


def test_validate_tells_it_beside_what_is_invalid(folder: Path) -> None:
    validated = called(folder, "validate")
    assert validated.returncode == 3
    assert f"b.sim.yml: {SAID}\nTraceback (most recent call last):\n" in validated.stdout
    assert "c.sim.yml:9:15: expect.0.upright.max_tilt: " in validated.stdout
    assert "1 valid, 1 invalid, 1 not checked to the end" in validated.stderr
