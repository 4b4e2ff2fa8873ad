"""What a checkout leaves in the workspace: the traces of actions/checkout in `.git`."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from sim_action.cli.pyproject import default_map
from sim_action.core.workspace import Workspace
from tests.integration.github import WorkflowResult
from tests.integration.github.conftest import CHECKOUT, Perform, printed, run, run_job, uses

URL = "https://github.com/octocat/robots"
LOOK = """\
echo "$GITHUB_SHA" "$(git rev-parse HEAD)" "$(git symbolic-ref -q HEAD)" "$(git remote get-url origin)"
git for-each-ref --format='%(objectname) %(refname)'
git status --porcelain
cat .git/FETCH_HEAD
"""


def looked(perform: Perform, event_name: str, inputs: dict[str, str]) -> list[str]:
    steps = f"    steps:\n{uses(CHECKOUT, inputs)}{run(LOOK)}"
    result: WorkflowResult = perform(
        f"on: [push, pull_request]\njobs:\n  a:\n    runs-on: ubuntu-latest\n{steps}", event_name=event_name
    )
    return result.runs[0].log.splitlines()


@pytest.mark.parametrize("inputs", [{}, {"ref": "main", "fetch-depth": "0"}, {"ref": "${{ github.ref }}"}])
def test_a_push_is_on_its_branch(perform: Perform, inputs: dict[str, str]) -> None:
    lines = looked(perform, "push", inputs)
    sha = lines[0].split()[0]
    assert lines == [
        f"{sha} {sha} refs/heads/main {URL}",
        f"{sha} refs/heads/main",
        f"{sha} refs/remotes/origin/main",
        f"{sha}\t\t'{sha}' of {URL}",
    ]


def test_a_pull_request_is_a_merge_commit_without_a_branch(perform: Perform) -> None:
    lines = looked(perform, "pull_request", {})
    sha = lines[0].split()[0]
    assert lines == [f"{sha} {sha}  {URL}", f"{sha} refs/remotes/pull/1/merge", f"{sha}\t\t'{sha}' of {URL}"]


def test_the_commit_holds_what_was_not_committed(perform: Perform, repository: Path) -> None:
    committed, new, ignored = (repository / name for name in ("committed", "new", "tracked though ignored"))
    (repository / ".gitignore").write_text("tracked*\n", encoding="utf-8")
    for file in (committed, ignored):
        file.write_text("old", encoding="utf-8")
    for command in (["init", "--quiet"], ["add", "--force", "."]):
        subprocess.run(["git", *command], cwd=repository, check=True)
    for file in (committed, new):
        file.write_text("new", encoding="utf-8")
    (repository / "link").symlink_to("nowhere")
    new.chmod(0o755)
    look = run("cat committed new tracked*; readlink link; test -x new && git status --porcelain")
    assert printed(run_job(perform, uses(CHECKOUT), look)) == "newnewoldnowhere\n"


def test_the_files_decide_on_the_commit(perform: Perform, repository: Path) -> None:
    def commit() -> str:
        return printed(run_job(perform, uses(CHECKOUT), run("echo ${{ github.sha }}")))

    first = commit()
    assert commit() == first
    (repository / "new").touch()
    assert commit() != first


def test_repositories_in_the_repository_are_empty_folders(perform: Perform, repository: Path) -> None:
    inner = repository / "inner"
    identity = ["-c", "user.name=a", "-c", "user.email=a@example.com"]
    for folder in (repository, inner):
        folder.mkdir(exist_ok=True)
        subprocess.run(["git", "init", "--quiet"], cwd=folder, check=True)
    subprocess.run(["git", *identity, "commit", "--quiet", "--allow-empty", "-m", "a"], cwd=inner, check=True)
    subprocess.run(["git", "-c", "advice.addEmbeddedRepo=false", "add", "inner"], cwd=repository, check=True)
    (inner / "file").touch()
    assert printed(run_job(perform, uses(CHECKOUT), run("ls -A inner; echo done"))) == "done\n"


def test_a_folder_of_the_checkout_belongs_to_its_workspace(perform: Perform, repository: Path) -> None:
    (repository / "simulation").mkdir()
    (repository / "simulation/robot.sim.yml").touch()
    (repository / "pyproject.toml").write_text("[tool.sim-action]\nseed = 7\n", encoding="utf-8")
    [only] = run_job(perform, uses(CHECKOUT)).runs
    folder = only.workspace / "simulation"
    assert Workspace.around(folder / "robot.sim.yml").root == only.workspace
    assert default_map("run", folder) == {"run": {"seed": 7}}
