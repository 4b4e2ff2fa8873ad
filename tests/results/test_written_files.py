"""Only files that sim-action has written are overwritten."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import UsageError
from sim_action.results.written_files import is_comparison, is_foreign, is_own_junit, refuse_foreign_files

GOLDEN = Path(__file__).parents[1] / "reports/golden"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<testsuites name='sim-action'/>", True),
        ("<?xml version='1.0'?>\n<!-- merged -->\n<testsuites tests='1' name='sim-action'>", True),
        ("<testsuites name='sim-action'><broken", True),
        ("<testsuites/>", False),
        ('<testsuite name="sim-action"><testcase', False),
        ("<?xml version='1.0'?>\n<!-- sim-action -->\n<testsuites name='pytest tests'>", False),
        ("<testsuites><testsuite name='sim-action'>", False),
        ("<robot name='sim-action'><testsuites name='sim-action'/></robot>", False),
        ("<!-- <testsuites> --><robot/>", False),
        ("<?xml version='1.0' encoding='nothing'?><testsuites/>", False),
        ("name: a\nexpect: []\n", False),
        ("\0\1\2", False),
        (" ", False),
    ],
)
def test_the_root_and_its_name_make_a_file_our_junit_xml(text: str, expected: bool) -> None:
    assert is_own_junit(text.encode()) is expected


@given(st.binary(max_size=300))
def test_any_bytes_are_recognised_or_not(data: bytes) -> None:
    assert is_own_junit(data) in (True, False)
    assert is_comparison(data) in (True, False)


def test_reports_of_every_kind_are_recognised() -> None:
    for path in GOLDEN.glob("*.xml"):
        assert not is_foreign(path, is_own_junit)
    assert not is_foreign(GOLDEN / "comparison.md", is_comparison)
    assert is_foreign(GOLDEN / "passed.md", is_comparison)
    assert not is_foreign(GOLDEN / "missing", is_comparison)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("results.json", '{"name": "my results"}'),
        ("results.json", "[]"),
        ("results.jsonl", '{"event": 1}\n'),
        ("report.html", "<!doctype html><p>My report"),
        ("junit.xml", "<robot/>"),
        ("traces/a.npz", "x"),
        ("replays/a.json.gz", "x"),
        ("recordings/a.csv", "time,x\n"),
    ],
)
def test_a_file_of_the_user_in_the_output_folder_is_kept(name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=f"has a file '{name}' that sim-action did not write.*choose another folder"):
        refuse_foreign_files(tmp_path)
    path.write_bytes(b"")
    if path.parent == tmp_path:
        refuse_foreign_files(tmp_path)


@pytest.mark.parametrize("name", ["results.json", "results.jsonl", "report.html", "junit.xml"])
@pytest.mark.parametrize("target", ["outside", "missing"])
def test_no_file_is_read_through_a_link(
    name: str, target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "outside").write_text("secret")
    (tmp_path / "results" / name).symlink_to(tmp_path / target)
    opened: list[object] = []
    real = os.open

    def open_(path: str, flags: int, *more: int) -> int:
        descriptor = real(path, flags, *more)
        opened.append(path)
        return descriptor

    monkeypatch.setattr(os, "open", open_)
    with pytest.raises(UsageError, match=f"'.*/results/{name}' is a link, .* not written through links; remove it"):
        refuse_foreign_files(tmp_path / "results")
    assert not opened


def test_other_files_and_folders_of_the_user_do_not_matter(tmp_path: Path) -> None:
    for name in ("robot.urdf", "traces/notes.txt", "recordings/ride.bag", "a.sim.yml", "tests.xml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    refuse_foreign_files(tmp_path)


def test_a_missing_folder_has_no_files(tmp_path: Path) -> None:
    refuse_foreign_files(tmp_path / "missing")
    (tmp_path / "file").touch()
    refuse_foreign_files(tmp_path / "file")
