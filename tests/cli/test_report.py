"""`sim-action report`: the folder that it takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.cli.main import call


@pytest.mark.parametrize(("typed", "meant"), [("out/report.html", "out"), ("results.json", ".")])
def test_a_file_is_refused_and_its_folder_is_named(
    typed: str, meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(typed).parent.mkdir(exist_ok=True)
    Path(typed).touch()
    assert call(["report", typed]) == 2
    assert capsys.readouterr().err == (
        f"sim-action: expected the output folder of a run, found the file '{typed}'; name '{meant}'\n"
    )
