"""What stands in for upload-artifact and download-artifact."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from tests.integration.github import JobResult, UnsupportedFeature
from tests.integration.github.conftest import Act, Perform, printed, run, run_job, uses

UPLOAD = "actions/upload-artifact@043fb46d1a93c77aae656e7c1c64a875d1fc6a0a"
DOWNLOAD = "actions/download-artifact@3e5f45b2cfb9172054b4087a40e8e0b5a5461e7c"
MAKE = run("mkdir -p out/deep/.git; touch out/a out/b.tmp out/.hidden out/deep/c out/deep/.git/d; touch single")


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
        ("out/a", ["a"]),
        ("out/*", ["a", "b.tmp", "deep/c"]),
        ("out/**/c", ["deep/c"]),
        ("out/d*", ["deep/c"]),
        ("out\n!out/*.tmp\n", ["a", "deep/c"]),
        ("out\n!out/deep", ["a", "b.tmp"]),
        ("single\nout/deep", ["out/deep/c", "single"]),
        ("out/a\nmissing", ["out/a"]),
        ("out/a\nout/deep", ["a", "deep/c"]),
        ("# note\nout/a\nout/a", ["a"]),
        ("${{ github.workspace }}/out/a", ["a"]),
    ],
)
def test_paths_in_an_artifact(perform: Perform, path: str, files: list[str]) -> None:
    assert uploaded(run_job(perform, MAKE, upload(path, name="x"))) == [f"x/{file}" for file in files]


@pytest.mark.parametrize("path", ["out/.hidden", "out/deep/.git"])
def test_hidden_files_are_left_out(perform: Perform, path: str) -> None:
    assert uploaded(run_job(perform, MAKE, upload(path))) == []
    assert len(uploaded(run_job(perform, MAKE, upload(path, include_hidden_files="true")))) == 1


def test_wildcards_match_hidden_files_where_those_are_wanted(perform: Perform) -> None:
    files = uploaded(run_job(perform, MAKE, upload("out/*d*n", include_hidden_files="true")))
    assert files == ["artifact/.hidden"]


@pytest.mark.parametrize(
    ("answer", "result", "levels"),
    [
        ("warn", "success", ["warning"]),
        ("error", "failure", ["error"]),
        ("ignore", "success", []),
        ("other", "failure", ["error"]),
    ],
)
def test_no_files_found(perform: Perform, answer: str, result: str, levels: list[str]) -> None:
    ended = run_job(perform, upload("none", if_no_files_found=answer))
    assert (ended.result, [annotation.level for annotation in ended.annotations]) == (result, levels)


@pytest.mark.parametrize("character", list('":<>|*?/\\\n\r'))
def test_names_that_are_forbidden(perform: Perform, character: str) -> None:
    ended = run_job(perform, MAKE, upload("single", name=f"a{character}b"))
    assert (ended.result, uploaded(ended)) == ("failure", [])
    assert "artifact name is not valid" in ended.annotations[0].message


@pytest.mark.parametrize("character", list('":<>|*?'))
def test_files_that_are_forbidden(perform: Perform, character: str) -> None:
    ended = run_job(perform, run(f"mkdir out; touch 'out/a{character}'"), upload("out"))
    assert (ended.result, uploaded(ended)) == ("failure", [])
    assert "path for one of the files" in ended.annotations[0].message


def test_a_name_is_there_once(perform: Perform) -> None:
    again = uses(UPLOAD, {"path": "out/a"}, "again")
    ended = run_job(perform, MAKE, upload("single"), again)
    assert ended.result == "failure"
    assert "409" in ended.annotations[0].message
    replaced = run_job(perform, MAKE, uses(UPLOAD, {"path": "single"}, "first"), upload("out/a", overwrite="true"))
    assert (replaced.result, uploaded(replaced)) == ("success", ["artifact/a"])


@pytest.mark.parametrize(
    ("days", "result"), [("91", "failure"), ("-1", "failure"), ("x", "failure"), ("90", "success")]
)
def test_retention_is_checked(perform: Perform, days: str, result: str) -> None:
    assert run_job(perform, MAKE, upload("single", retention_days=days)).result == result


def test_outputs_lead_to_the_artifact(perform: Perform) -> None:
    step = run_job(perform, MAKE, upload("single", name="x")).steps[1]
    assert step.outputs["artifact-id"] == "1"
    assert step.outputs["artifact-url"].endswith("/artifacts/1")
    assert len(step.outputs["artifact-digest"]) == 64


@pytest.mark.parametrize(
    ("inputs", "files"),
    [
        ({"name": "r-1"}, ["1"]),
        ({"name": "r-1", "path": "to/here"}, ["to/here/1"]),
        ({"pattern": "r-*", "path": "all"}, ["all/r-1/1", "all/r-2/2"]),
        ({"pattern": "r-[2]", "path": "all"}, ["all/r-2/2"]),
        ({"pattern": "r-*", "merge-multiple": "true"}, ["1", "2"]),
        ({"pattern": "none-*"}, []),
        ({}, ["other/3", "r-1/1", "r-2/2"]),
    ],
)
def test_downloads(perform: Perform, inputs: Mapping[str, str], files: list[str]) -> None:
    text = "on: push\njobs:\n  a:\n    runs-on: ubuntu-latest\n    steps:\n"
    for file, name in (("1", "r-1"), ("2", "r-2"), ("3", "other")):
        text += run(f"touch {file}") + uses(UPLOAD, {"name": name, "path": file}, f"u{file}")
    text += "  b:\n    needs: a\n    runs-on: ubuntu-latest\n    steps:\n" + uses(DOWNLOAD, inputs)
    workspace = perform(text).jobs["b"].runs[0].workspace
    assert sorted(str(file.relative_to(workspace)) for file in workspace.rglob("*") if file.is_file()) == files


def test_an_artifact_that_is_not_there_fails_the_step(perform: Perform) -> None:
    ended = run_job(perform, uses(DOWNLOAD, {"name": "x"}))
    assert ended.result == "failure"
    assert "not found for name: x" in ended.annotations[0].message


def test_runs_do_not_see_the_artifacts_of_others(perform: Perform) -> None:
    assert run_job(perform, MAKE, upload("single", name="x")).result == "success"
    assert run_job(perform, uses(DOWNLOAD, {"name": "x"})).result == "failure"


def test_downloads_say_where_they_are(perform: Perform) -> None:
    step = uses(DOWNLOAD, {"path": "here"})
    ended = run_job(perform, step, run("basename ${{ steps.it.outputs.download-path }}"))
    assert printed(ended).endswith("here\n")


@pytest.mark.parametrize(
    "step",
    [
        uses(DOWNLOAD, {"run-id": "5"}),
        uses(DOWNLOAD, {"pattern": "{a,b}"}),
        uses(DOWNLOAD, {"pattern": "!a"}),
        upload("{a,b}"),
        upload("a", archive="false"),
    ],
)
def test_what_is_not_known_is_refused(perform: Perform, step: str) -> None:
    with pytest.raises(UnsupportedFeature):
        run_job(perform, step)


def test_artifacts_belong_to_a_workflow_run(act: Act) -> None:
    steps = json.dumps([{"uses": UPLOAD, "with": {"path": "a"}}])
    with pytest.raises(UnsupportedFeature, match="workflow run"):
        act(f"name: a\nruns: {{using: composite, steps: {steps}}}")
