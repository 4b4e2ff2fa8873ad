"""Golden files of what the reports make of results of every kind.

After a wanted change of a report: `pytest tests/reports --update-golden`, then read the difference.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sim_action.reports import ReportOptions
from tests.reports.samples import SAMPLES

GOLDEN = Path(__file__).parent / "golden"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the golden files of the reports anew")


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """Compares a text with a golden file; a missing file is a failure unless the files are being updated."""

    def compare(name: str, text: str) -> None:
        path = GOLDEN / name
        if request.config.getoption("--update-golden", default=False):
            path.write_text(text, encoding="utf-8", newline="\n")
        assert path.exists(), f"no golden file {name}; see conftest.py"
        assert text == path.read_text(encoding="utf-8")

    return compare


@pytest.fixture(params=sorted(SAMPLES))
def kind(request: pytest.FixtureRequest) -> str:
    """Each kind of results in turn."""
    name: str = request.param
    return name


@pytest.fixture
def options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ReportOptions:
    """Reports of a run in an empty workspace, which is the current folder."""
    monkeypatch.chdir(tmp_path)
    folder = Path("sim-results")
    return ReportOptions(folder, folder / "junit.xml", junit_strict=False, environment={}, workspace=tmp_path)
