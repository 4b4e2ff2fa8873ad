"""What stands in for upload-artifact and download-artifact."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from tests.integration.github import JobResult, UnsupportedFeature
from tests.integration.github.conftest import Act, Perform, printed, run, run_job, uses

UPLOAD = "actions/upload-artifact@043fb46d1a93c77aae656e7c1c64a875d1fc6a0a"
DOWNLOAD = "actions/download-artifact@3e5f45b2cfb9172054b4087a40e8e0b5a5461e7c"
MAKE = run("mkdir -p out/deep/.git; touch out/a out/b.tmp out/.hidden out/deep/c out/deep/.git/d")


def upload(path: str, **more: str) -> str:
    return uses(UPLOAD, {"path": path, **{name.replace("_", "-"): value for name, value in more.items()}})


def uploaded(result: JobResult) -> list[str]:
    folder = result.runs[0].workspace.parents[2] / "artifacts"
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


@pytest.mark.parametrize(
    ("path", "files"),
    [
        ("out", ["a", "b.tmp", "deep/c"]),
        ("out/", ["a", "b.tmp", "deep/c"]),
        ("out/deep", ["c"]),
        ("${{ github.workspace }}/out/deep", ["c"]),
        ("out/deep/.git", []),
    ],
)
def test_paths_in_an_artifact(perform: Perform, path: str, files: list[str]) -> None:
    assert uploaded(run_job(perform, MAKE, upload(path, name="x"))) == [f"x/{file}" for file in files]


def test_no_files_found(perform: Perform) -> None:
    ended = run_job(perform, upload("none"))
    assert (ended.result, [annotation.level for annotation in ended.annotations]) == ("success", ["warning"])


def test_a_file_without_an_archive_is_an_artifact_of_its_name(perform: Perform) -> None:
    assert uploaded(run_job(perform, MAKE, upload("out/a", archive="false", name="x"))) == ["a/a"]
    assert uploaded(run_job(perform, upload("none", archive="false"))) == []


def test_an_upload_says_where_it_is(perform: Perform) -> None:
    tell = run("echo at ${{ steps.it.outputs.artifact-url }}")
    assert "at https://github.com/" in printed(run_job(perform, MAKE, upload("out"), tell))
    assert printed(run_job(perform, upload("none"), tell)).endswith("at\n")


def test_a_name_is_there_once(perform: Perform) -> None:
    ended = run_job(perform, MAKE, upload("out"), uses(UPLOAD, {"path": "out/deep"}, "again"))
    assert ended.result == "failure"
    assert "409" in ended.annotations[0].message


@pytest.mark.parametrize("character", list('":<>|*?/\\\n\r'))
def test_names_that_are_forbidden(perform: Perform, character: str) -> None:
    ended = run_job(perform, MAKE, upload("out", name=f"a{character}b"))
    assert (ended.result, uploaded(ended)) == ("failure", [])
    assert "artifact name is not valid" in ended.annotations[0].message


@pytest.mark.parametrize("character", list('":<>|*?'))
def test_files_that_are_forbidden(perform: Perform, character: str) -> None:
    ended = run_job(perform, run(f"mkdir out; touch 'out/a{character}'"), upload("out"))
    assert (ended.result, uploaded(ended)) == ("failure", [])
    assert "path for one of the files" in ended.annotations[0].message


@pytest.mark.parametrize(
    ("inputs", "files"),
    [
        ({"name": "r-1", "path": "."}, ["1"]),
        ({"name": "r-1", "path": "to/here"}, ["to/here/1"]),
        ({"pattern": "r-*", "path": "all"}, ["all/r-1/1", "all/r-2/2"]),
        ({"pattern": "none-*", "path": "all"}, []),
    ],
)
def test_downloads(perform: Perform, inputs: Mapping[str, str], files: list[str]) -> None:
    text = "on: push\njobs:\n  a:\n    runs-on: ubuntu-latest\n    steps:\n"
    for file, name in (("1", "r-1"), ("2", "r-2"), ("3", "other")):
        text += run(f"mkdir {name}; touch {name}/{file}") + uses(UPLOAD, {"name": name, "path": name}, f"u{file}")
    text += "  b:\n    needs: a\n    runs-on: ubuntu-latest\n    steps:\n" + uses(DOWNLOAD, inputs)
    workspace = perform(text).jobs["b"].runs[0].workspace
    assert sorted(str(file.relative_to(workspace)) for file in workspace.rglob("*") if file.is_file()) == files


def test_an_artifact_that_is_not_there_fails_the_step(perform: Perform) -> None:
    ended = run_job(perform, uses(DOWNLOAD, {"name": "x", "path": "."}))
    assert ended.result == "failure"
    assert "not found for name: x" in ended.annotations[0].message


def test_runs_do_not_see_the_artifacts_of_others(perform: Perform) -> None:
    assert run_job(perform, MAKE, upload("out", name="x")).result == "success"
    assert run_job(perform, uses(DOWNLOAD, {"name": "x", "path": "."})).result == "failure"


@pytest.mark.parametrize(
    "step",
    [
        uses(DOWNLOAD, {"name": "a", "path": "a", "run-id": "5"}),
        uses(DOWNLOAD, {"pattern": "{a,b}", "path": "a"}),
        uses(DOWNLOAD, {"pattern": "!a", "path": "a"}),
        uses(DOWNLOAD, {"name": "a", "pattern": "a*", "path": "a"}),
        uses(DOWNLOAD, {"path": "a"}),
        upload("out/*"),
        upload("out\nout/deep"),
        upload("out/a"),
        upload("out", archive="false"),
        upload("out") + run("echo ${{ steps.it.outputs.artifact-digest }}"),
    ],
)
def test_what_is_not_known_is_refused(perform: Perform, step: str) -> None:
    with pytest.raises(UnsupportedFeature):
        run_job(perform, MAKE, step)


def test_artifacts_belong_to_a_workflow_run(act: Act) -> None:
    steps = json.dumps([{"uses": UPLOAD, "with": {"path": "a"}}])
    with pytest.raises(UnsupportedFeature, match="workflow run"):
        act(f"name: a\nruns: {{using: composite, steps: {steps}}}")
