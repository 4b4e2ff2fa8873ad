"""Recordings come to be whole or not at all, and cost no verdict."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO, ClassVar

import pytest

from sim_action.recording.export import csv_table
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.writing import write_recordings
from tests.recording.export.runs import run


class Breaking:
    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(_made: RecordedRun, file: BinaryIO) -> None:
        file.write(b"half of it")
        raise OSError("no space\nleft")


def test_what_cannot_be_written_is_told_and_the_others_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_table, "CsvTable", Breaking)
    folder = tmp_path / "recordings"
    (note,) = write_recordings(run(), [folder / "a.csv", folder / "a.tum"])
    assert note == "it is not recorded as csv: OSError: no space\\nleft"
    assert [path.name for path in folder.iterdir()] == ["a.tum"]
