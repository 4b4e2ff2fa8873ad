"""A stand-in for actions/checkout: a repository of one or two commits, and what a checkout leaves in the workspace."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.stand_in import NO_OUTPUTS, StandIn
from tests.integration.github.values import Value, to_text

# The same files are the same commit, on every machine and at every time.
_IDENTITY: Final = {
    f"GIT_{role}_{key}": value
    for role in ("AUTHOR", "COMMITTER")
    for key, value in (("NAME", "octocat"), ("EMAIL", "octocat@example.com"), ("DATE", "2024-01-01T00:00:00Z"))
}
_NO_SETTINGS: Final = {"GIT_CONFIG_NOSYSTEM": "1", "GIT_CONFIG_GLOBAL": os.devnull}
# Each job of a workflow fetches the commit: nothing is compressed or compared to make it smaller.
_ORIGIN_CONFIG: Final = """\
[core]
\tcompression = 0
[pack]
\twindow = 0
"""
_CONFIG: Final = """\
[remote "origin"]
\turl = {url}
\tfetch = +refs/heads/*:refs/remotes/origin/*
[gc]
\tauto = 0
"""


def commit(repository: Path, origin: Path, base: Path | None = None) -> str:
    """Keeps the state of a folder as the last commit of the branch main of a new repository, and returns its SHA.

    Of a work tree, all files that git does not ignore, committed or not; of another folder, all files. `base`: a folder
    whose state is the commit before; None: there is none. Raises UnsupportedFeature.
    """
    _git("init", "--bare", "--template=", str(origin))
    with (origin / "config").open("a", encoding="utf-8") as config:
        config.write(_ORIGIN_CONFIG)
    for folder in (repository,) if base is None else (base, repository):
        _commit(folder, origin)
    return (origin / "refs/heads/main").read_text(encoding="utf-8").strip()


def _commit(folder: Path, origin: Path) -> None:
    tree = ("--git-dir", str(origin), "--work-tree", str(folder))
    if (folder / ".git").exists():
        names = "\0".join(_tracked(folder))
        _git(*tree, "update-index", "-z", "--add", "--stdin", stdin=names, folder=folder)
    else:
        _git(*tree, "add", "--all", "--force", ".", folder=folder)
    _git(*tree, "commit", "--quiet", "--allow-empty", "--message", "The state of the folder", folder=folder)


def _tracked(repository: Path) -> Iterable[str]:
    """Files, links and submodules; git would not find a submodule that was not fetched, or a repository in it."""
    listed = _git("ls-files", "-z", "--cached", "--others", "--exclude-standard", folder=repository, settings={})
    for name in dict.fromkeys(listed.split("\0")):
        path = repository / name
        is_folder = path.is_dir() and not path.is_symlink()
        if name and not name.endswith("/") and os.path.lexists(path) and (not is_folder or (path / ".git").exists()):
            yield name


def _check_out(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    if not machine.origin:
        raise UnsupportedFeature("a checkout outside a workflow run")
    github, folder = machine.github, machine.workspace
    if (ref := inputs["ref"]) and ref not in _refs(github):
        raise UnsupportedFeature(f"ref: {ref}, where there is only {', '.join(sorted(_refs(github)))}")
    # As there: what was in the folder before does not survive.
    shutil.rmtree(folder, ignore_errors=True)
    _git("init", "--template=", str(folder))
    url = f"{to_text(github['server_url'])}/{to_text(github['repository'])}"
    with (folder / ".git/config").open("a", encoding="utf-8") as config:
        config.write(_CONFIG.format(url=url))
    sha = to_text(github["sha"])
    branch, local = _places(ref or to_text(github["ref"]), sha)
    depth = [f"--depth={inputs['fetch-depth']}"] if inputs["fetch-depth"] != "0" else []
    _git("fetch", "--no-tags", *depth, str(machine.origin), f"+refs/heads/main:{branch}", folder=folder)
    (folder / ".git/FETCH_HEAD").write_text(f"{sha}\t\t'{sha}' of {url}\n", encoding="utf-8")
    _git("checkout", "--quiet", "--force", *local, branch, folder=folder)
    return NO_OUTPUTS


def _refs(github: Mapping[str, Value]) -> set[str]:
    """The names of the only commit."""
    branch = "head_ref" if github["event_name"] == "pull_request" else "ref_name"
    return {to_text(github[name]) for name in ("sha", "ref", branch)}


def _places(ref: str, sha: str) -> tuple[str, tuple[str, ...]]:
    """Where a checkout puts a ref, and how it names the branch; without a name, HEAD is the commit itself."""
    if ref.startswith("refs/pull/"):
        return ref.replace("refs/", "refs/remotes/", 1), ("--detach",)
    if ref == sha:
        return "refs/remotes/origin/main", ("--detach",)
    name = ref.removeprefix("refs/heads/")
    return f"refs/remotes/origin/{name}", ("-B", name)


def _git(
    *arguments: str, folder: Path | None = None, stdin: str = "", settings: Mapping[str, str] = _NO_SETTINGS
) -> str:
    """Runs git without the variables of another one around it. Raises UnsupportedFeature."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    variables = {**kept, **_IDENTITY, **settings}
    quiet = ["git", "-c", "init.defaultBranch=main", "-c", "advice.addEmbeddedRepo=false", *arguments]
    finished = subprocess.run(
        quiet, cwd=folder, env=variables, input=stdin, capture_output=True, encoding="utf-8", check=False
    )
    if finished.returncode:
        raise UnsupportedFeature(f"git {arguments[0]}: {finished.stderr.strip()}")
    return finished.stdout


CHECK_OUT: Final = StandIn(_check_out, defaults={"persist-credentials": "true", "ref": "", "fetch-depth": "1"})
