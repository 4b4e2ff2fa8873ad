from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.reports import ReportRequest, workspace_of
from sim_action.reports.writing import open_reports
from sim_action.results.output_folder import locked
from tests.outcomes import outcome, results, stored


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "workspace").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "workspace")
    return tmp_path / "workspace"


def asked(folder: str, junit: str | None = None) -> ReportRequest:
    path = Path(junit) if junit else None
    return ReportRequest(folder=Path(folder), junit=path, junit_strict=False, verbosity="normal", silenced=frozenset())


def assert_refused(request: ReportRequest, message: str) -> None:
    with pytest.raises(UsageError, match=message), open_reports(request):
        pass


def test_runs_to_compare_with(workspace: Path) -> None:
    # The run to compare with is read first.
    stored(workspace / "old", results(outcome("a.sim.yml")))
    with open_reports(replace(asked("new"), against="old")) as options:
        assert options.against is not None
        assert [each.file for each in options.against.outcomes] == ["a.sim.yml"]
    # A run is not compared with what it overwrites.
    path = stored(workspace / "out", results(outcome("a.sim.yml")))
    message = "--against out is the output folder of this call; keep the earlier results in another folder"
    assert_refused(replace(asked("out"), against="out"), message)
    assert path.is_file()


@pytest.mark.parametrize(
    ("against", "content", "message"),
    [
        ("none", None, "--against: no results.json found at 'none'; name a results file or its folder"),
        ("old", "{}", "--against: old/results.json is not a valid results file: sim_action: Field required"),
        ("old", '{"version": 99}', "its format version is 99, and this sim-action reads 1 to 5"),
    ],
)
def test_a_run_that_cannot_be_compared_with_is_refused_before_anything_is_written(
    against: str, content: str | None, message: str, workspace: Path
) -> None:
    if content is not None:
        (workspace / "old").mkdir()
        (workspace / "old/results.json").write_text(content)
    assert_refused(replace(asked("new"), against=against), re.escape(message))
    assert not (workspace / "new").exists()


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
    assert_refused(asked(folder, junit), f"'{link}' is a link")
    assert list((workspace.parent / "elsewhere").iterdir()) == []


def test_links_and_special_files(workspace: Path) -> None:
    # A dangling link is a link.
    (workspace / "out").symlink_to("nowhere")
    assert_refused(asked("out"), "'out' is a link")
    (workspace / "out").unlink()
    # Links above and outside are the callers.
    (workspace.parent / "link").symlink_to("elsewhere")
    with open_reports(asked(str(workspace.parent / "link/out"))):
        pass
    assert (workspace.parent / "elsewhere/out").is_dir()
    # A junit path that no file can replace is refused before anything runs.
    os.mkfifo(workspace / "pipe")
    for path, why in (("/dev/full", "is not a regular file"), ("pipe", "is not a regular file"), (".", "is a folder")):
        assert_refused(asked("out", path), f"--junit {path} {why}")
    assert not (workspace / "out").exists()


@pytest.mark.parametrize("name", ["results.jsonl", "results.json", "report.html"])
def test_the_junit_is_not_written_onto_another_report(workspace: Path, name: str) -> None:
    (workspace / "out/deeper").mkdir(parents=True)
    (workspace / "out" / name).write_text("of an earlier call")
    for path in (f"out/{name}", f"out/deeper/../{name}", str(workspace / "out" / name)):
        assert_refused(asked("out", path), f"is the {name} of this call")
    assert (workspace / "out" / name).read_text() == "of an earlier call"
    (workspace / "out" / name).unlink()
    with open_reports(asked("out", f"out/deeper/{name}")):
        pass


@pytest.mark.parametrize("name", ["a.sim.yml", "a.YAML"])
def test_the_junit_is_not_written_onto_a_scenario(workspace: Path, name: str) -> None:
    (workspace / name).write_text("name: a")
    assert_refused(asked("out", name), "ends like a scenario file")
    assert (workspace / name).read_text() == "name: a"


def test_the_junit_of_an_earlier_call_is_removed_at_the_start(workspace: Path) -> None:
    for name in ("stale.xml", "other.xml"):
        (workspace / name).write_text("<testsuites name='sim-action'/>")
    with open_reports(asked("out", "stale.xml")):
        assert not (workspace / "stale.xml").exists()
        assert (workspace / "other.xml").exists()


def test_git_ignores_a_folder_that_was_created_here_and_no_other(workspace: Path) -> None:
    (workspace / "mine").mkdir()
    for folder in ("made/deep", "mine", "."):
        with open_reports(asked(folder)) as options:
            assert options.junit == Path(folder, "junit.xml")
    assert [path for path in workspace.rglob("*") if path.is_file()] == [workspace / "made/deep/.gitignore"]
    assert (workspace / "made/deep/.gitignore").read_text() == "*\n"


def journal_of(folder: Path, *files: str) -> None:
    """Write the first line of a journal that lists these files, and make all of them."""
    header = {"journal": 1, "sim_action": "0", "python": "3.11", "platform": "here", "files": files}
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    (folder / "results.jsonl").write_text(json.dumps(header) + "\n")


def test_files_of_the_earlier_call_that_its_journal_lists_are_removed(workspace: Path) -> None:
    listed = ("results.jsonl", "results.json", "junit.xml", "report.html", "traces/a.npz", "robot.urdf", "../x.npz")
    journal_of(workspace / "out", *listed)
    (workspace / "out/traces/unlisted.npz").touch()
    with open_reports(asked("out"), keeps_earlier=True):
        assert all((workspace / "out" / name).exists() for name in listed)
    with open_reports(asked("out")):
        found = {path.relative_to(workspace).as_posix() for path in workspace.rglob("*") if path.is_file()}
    assert found - {"out/.sim-action.lock"} == {"out/traces/unlisted.npz", "out/robot.urdf", "x.npz"}


@pytest.mark.parametrize("journal", ["", '{"journal": 2, "sim_action": "9.0.0", "files": ["results.json"]}'])
def test_a_file_that_is_no_journal_lists_nothing(journal: str, workspace: Path) -> None:
    (workspace / "results.jsonl").write_text(journal)
    (workspace / "results.json").touch()
    with open_reports(asked(".")):
        assert (workspace / "results.json").exists()
    assert (workspace / "results.jsonl").read_text() == journal


@pytest.mark.parametrize("journal", ["[]", "{}", '{"journal": 1, "files": ["results.json"]}', '{"journal": 2}'])
def test_a_journal_of_another_program_is_kept_and_lists_nothing(journal: str, workspace: Path) -> None:
    (workspace / "results.jsonl").write_text(journal)
    (workspace / "results.json").touch()
    assert_refused(asked("."), r"'results\.jsonl' that sim-action did not write")
    assert (workspace / "results.json").exists()
    assert (workspace / "results.jsonl").read_text() == journal


def test_a_call_that_may_not_use_the_folder_removes_nothing(workspace: Path) -> None:
    journal_of(workspace / "out", "results.json")
    (workspace / "junit.xml").touch()
    with locked(Path("out")):
        assert_refused(asked("out", "junit.xml"), "in use by another run")
    assert (workspace / "out/results.json").exists()
    assert (workspace / "junit.xml").exists()


@pytest.mark.parametrize(("folder", "junit"), [("x" * 300, None), ("out", "x" * 300)])
def test_a_name_that_is_too_long_is_refused(folder: str, junit: str | None, workspace: Path) -> None:
    assert_refused(asked(folder, junit), "cannot be used: file name too long")
    assert not (workspace / "out").exists()


def test_junit_xml_that_is_kept(workspace: Path) -> None:
    # Junit xml of another tool is kept.
    text = "<testsuites name='pytest tests'><testsuite name='pytest' tests='1'/></testsuites>"
    (workspace / "theirs.xml").write_text(text)
    assert_refused(asked("out", "theirs.xml"), r"theirs\.xml exists, and sim-action did not write it; .* or remove it")
    assert (workspace / "theirs.xml").read_text() == text
    # Junit xml that is a link is not read.
    (workspace / "target.xml").write_text("<testsuites name='sim-action'/>")
    (workspace / "tests.xml").symlink_to("target.xml")
    assert_refused(asked("out", "tests.xml"), r"'tests\.xml' is a link, and results are not written through links")


@pytest.mark.parametrize("name", ["robot.urdf", "notes", "model.xml"])
def test_a_file_that_is_not_junit_xml_is_kept(name: str, workspace: Path) -> None:
    (workspace / name).write_text("<robot name='a'/>")
    assert_refused(asked("out", name), f"--junit {name} exists, and sim-action did not write it; name another")
    assert (workspace / name).read_text() == "<robot name='a'/>"
    assert not (workspace / "out").exists()


def test_a_file_of_the_user_in_the_output_folder_is_kept_and_an_empty_one_replaced(workspace: Path) -> None:
    (workspace / "tests.xml").touch()
    with open_reports(asked("out", "tests.xml")):
        pass
    (workspace / "results.json").write_text("{}")
    assert_refused(asked("."), r"'results\.json' that sim-action did not write")
    assert (workspace / "results.json").read_text() == "{}"


JENKINS = {"JENKINS_URL": "http://ci/"}


@pytest.mark.parametrize(
    ("name", "marks"),
    [("GITHUB_WORKSPACE", {}), ("CI_PROJECT_DIR", {}), ("WORKSPACE", JENKINS), ("WORKSPACE", {"BUILD_TAG": "a-1"})],
)
def test_paths_are_relative_to_the_workspace_of_a_service(
    name: str, marks: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "repository/robot").mkdir(parents=True)
    below = tmp_path / "repository/robot"
    monkeypatch.chdir(below)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path / "repository"))
    with open_reports(asked("out")) as options:
        assert options.workspace == tmp_path / "repository"
    assert workspace_of({name: str(tmp_path / "repository"), **marks}, below) == tmp_path / "repository"
    # A variable of another program is no workspace.
    assert workspace_of({"WORKSPACE": "/"}, tmp_path) == workspace_of({}, tmp_path) == tmp_path


@pytest.mark.parametrize("value", ["/builds/of/another/machine", "relative", ".", "x" * 5000, "/dev/null"])
def test_a_workspace_that_does_not_exist_here_is_the_repository(value: str, tmp_path: Path) -> None:
    (tmp_path / "robot/deep").mkdir(parents=True)
    environment = {"CI_PROJECT_DIR": value}
    assert workspace_of(environment, tmp_path / "robot") == tmp_path / "robot"
    (tmp_path / ".git").mkdir()
    assert workspace_of(environment, tmp_path / "robot/deep") == tmp_path
    assert workspace_of({**environment, "GITHUB_WORKSPACE": str(tmp_path / "robot")}, tmp_path) == tmp_path / "robot"
