from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.reports import ReportRequest, report_options


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "workspace").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "workspace")
    return tmp_path / "workspace"


def asked(folder: str, junit: str | None = None) -> ReportRequest:
    return ReportRequest(
        folder=Path(folder),
        junit=Path(junit) if junit else None,
        junit_strict=False,
        verbosity="normal",
        silenced=frozenset(),
    )


def test_the_output_folder_is_made(workspace: Path) -> None:
    assert report_options(asked("a/b")).junit == Path("a/b/junit.xml")
    assert (workspace / "a/b").is_dir()


@pytest.mark.parametrize(
    ("link", "folder", "junit"),
    [
        ("out", "out", None),
        ("out", "out/deeper", None),
        ("out/traces", "out", None),
        ("out/replays", "out", None),
        ("reports", "out", "reports/junit.xml"),
        ("reports", "out", "reports/deeper/junit.xml"),
    ],
)
def test_a_link_that_a_checkout_holds_is_not_written_through(
    link: str, folder: str, junit: str | None, workspace: Path
) -> None:
    (workspace / link).parent.mkdir(exist_ok=True)
    (workspace / link).symlink_to(workspace.parent / "elsewhere")
    with pytest.raises(UsageError, match=f"'{link}' is a link"):
        report_options(asked(folder, junit))
    assert list((workspace.parent / "elsewhere").iterdir()) == []


def test_a_dangling_link_is_a_link(workspace: Path) -> None:
    (workspace / "out").symlink_to("nowhere")
    with pytest.raises(UsageError, match="'out' is a link"):
        report_options(asked("out"))


def test_links_above_and_outside_are_the_callers(workspace: Path) -> None:
    (workspace.parent / "link").symlink_to("elsewhere")
    report_options(asked(str(workspace.parent / "link/out")))
    assert (workspace.parent / "elsewhere/out").is_dir()
