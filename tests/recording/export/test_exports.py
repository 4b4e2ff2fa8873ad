"""Which recordings there are, and what is told of those that cannot be made."""

from __future__ import annotations

import importlib.util
import io
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import pytest

from sim_action.core.errors import UsageError
from sim_action.recording import export as exports
from sim_action.recording.export import EXPORTS, csv_tum, wanted_formats, write_recordings
from sim_action.recording.export.recorded_run import RecordedRun
from tests.recording.export.runs import run


@pytest.mark.parametrize(
    ("typed", "wanted"),
    [
        ((), ()),
        (("csv",), ("csv",)),
        (("tum", "csv", "tum"), ("tum", "csv")),
        (("csv,tum", " gif , "), ("csv", "tum", "gif")),
    ],
)
def test_names_are_repeated_or_joined_by_commas(typed: tuple[str, ...], wanted: tuple[str, ...]) -> None:
    assert wanted_formats(typed) == wanted


@pytest.mark.parametrize(
    ("typed", "near"), [("mcpa", "mcap"), ("MP4", None), ("gif\n::error::", None), ("giff", "gif")]
)
def test_what_is_no_format_is_told_with_the_nearest_one(typed: str, near: str | None) -> None:
    with pytest.raises(UsageError) as refused:
        wanted_formats([typed])
    message = str(refused.value)
    assert "(allowed: csv, gif, mcap, mp4, tum)" in message
    assert "\n" not in message
    assert (f"did you mean '{near}'?" in message) == (near is not None)


@pytest.mark.parametrize(("name", "package", "extra"), [("mcap", "mcap", "mcap"), ("gif", "PIL", "video")])
def test_a_package_that_is_missing_is_told_with_how_to_come_by_it(
    name: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find_spec(wanted: str, *rest: Any) -> ModuleSpec | None:
        return None if wanted == package else importlib.util.find_spec(wanted, *rest)

    monkeypatch.setattr(exports, "find_spec", find_spec)
    assert wanted_formats(["csv"]) == ("csv",)
    reason = rf"record {name}.*{package}.*pip install 'sim-action\[{extra}\]'.*extras: {extra}"
    with pytest.raises(UsageError, match=reason):
        wanted_formats(["csv", name])


@pytest.mark.parametrize("name", list(EXPORTS))
def test_each_format_is_written_and_the_same_every_time(name: str) -> None:
    files = [io.BytesIO(), io.BytesIO()]
    for file in files:
        EXPORTS.load(name).write(run(), file)
    assert files[0].getvalue()
    assert files[0].getvalue() == files[1].getvalue()


class Breaking:
    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(_made: RecordedRun, file: BinaryIO) -> None:
        file.write(b"half of it")
        raise OSError("no space\nleft")


def test_what_cannot_be_written_is_told_and_the_others_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_tum, "CsvTable", Breaking)
    folder = tmp_path / "recordings"
    (note,) = write_recordings(run(), [folder / "a.csv", folder / "a.tum"])
    assert note == "recording as csv: no space\\nleft"
    assert [path.name for path in folder.iterdir()] == ["a.tum"]
