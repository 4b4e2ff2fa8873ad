"""Find out whether a checkout may hold files of strangers: a pull request, or a repository of another owner.

Only files of `.git` are read; git does not run. actions/checkout leaves these traces: the ref of a pull request in
refs/remotes/pull (loose or packed), the place of the last fetch in FETCH_HEAD, and the address of the repository in
remote.origin.url.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from sim_action.core.files import read_at_most
from sim_action.core.wording import escaped_line, shown

_MAX_BYTES: Final = 50_000_000  # of packed-refs
_MAX_LINK_BYTES: Final = 10_000
_MAX_DEPTH: Final = 2  # of `path:` of actions/checkout, below the workspace of the job
_MAX_FOLDERS: Final = 2_000
_MAX_REFS: Final = 10_000
_COMMIT: Final = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_REF: Final = re.compile(r"refs/[\w./@+-]+")
_PULL: Final = re.compile(r"refs/(?:remotes/(?:\w+/)?)?pull/[0-9]+/")
_URL: Final = re.compile(r"^\s*url\s*=\s*\"?([^\"\s]+)", re.MULTILINE)
_SECTION: Final = re.compile(r"^\s*\[([^\]]*)\]", re.MULTILINE)
_FETCHED_FROM: Final = re.compile(r" of (\S+)\s*$|^[0-9a-f]+\t[^\t]*\t(\S+)\s*$")
_SCP: Final = re.compile(r"(?:[\w.-]+@)?[\w.-]+:(?!//)(?P<path>.+)")

_OWN_COMMIT_ONLY: Final = "repository_dispatch"
"""The event that other workflows send on behalf of strangers, such as after a comment on a pull request.

A pull request that is checked out by its commit leaves no other trace.
"""


@dataclass(frozen=True, slots=True)
class _Repository:
    """The folder that a `.git` stands for.

    Attributes:
        own: the folder of HEAD and FETCH_HEAD.
        common: the folder of refs and config; worktrees of one repository share it.
        is_pinned: True for a submodule: another repository holds its commit.
    """

    own: Path
    common: Path
    is_pinned: bool = False

    @classmethod
    def at(cls, git: Path) -> _Repository | None:
        """Return the repository of a `.git`, which may be a file; None: there is none."""
        if git.is_dir():
            return cls(git, git)
        link = _text(git, _MAX_LINK_BYTES).strip()
        if not link.startswith("gitdir:") or "\0" in link:
            return None
        own = git.parent / link.removeprefix("gitdir:").strip()
        shared = _text(own / "commondir", _MAX_LINK_BYTES).strip().partition("\0")[0]
        return cls(own, own / shared if shared else own, is_pinned=not shared and "/.git/modules/" in own.as_posix())

    def head(self) -> str:
        """Return the commit that is checked out; an empty text if it is not known."""
        said = _text(self.own / "HEAD", _MAX_LINK_BYTES).strip()
        name = said.removeprefix("ref:").strip()
        if name == said or not _REF.fullmatch(name) or ".." in name:
            return said if _COMMIT.fullmatch(said) else ""
        loose = _text(self.common / name, _MAX_LINK_BYTES).strip()
        if loose:
            return loose if _COMMIT.fullmatch(loose) else ""
        return next((commit for commit, ref in self._packed() if ref == name), "")

    def pull_ref(self) -> str | None:
        """Return the name of a ref of a pull request; None: there is none."""
        remotes = self.common / "refs"
        for base in (remotes / "remotes", remotes / "pull"):
            for folder, _, files in _walked(base):
                for file in files:
                    name = Path(folder, file).relative_to(self.common).as_posix()
                    if _PULL.match(name):
                        return name
        return next((ref for _, ref in self._packed() if _PULL.match(ref)), None)

    def _packed(self) -> Iterator[tuple[str, str]]:
        for line in _text(self.common / "packed-refs", _MAX_BYTES).splitlines():
            commit, _, ref = line.partition(" ")
            if _COMMIT.fullmatch(commit):
                yield commit, ref.strip()

    def fetched(self) -> list[str]:
        """Return the lines of FETCH_HEAD: the last fetch."""
        return _text(self.own / "FETCH_HEAD", _MAX_BYTES).splitlines()

    def config(self) -> str:
        """Return the configuration."""
        return _text(self.common / "config", _MAX_BYTES)

    def origin(self) -> str | None:
        """Return the address of the remote `origin`."""
        text = self.config()
        for section in _SECTION.finditer(text):
            if section[1].split() == ["remote", '"origin"']:
                end = text.find("\n[", section.end())
                if found := _URL.search(text[section.end() : end if end >= 0 else len(text)]):
                    return found[1]
        return None


def foreign_checkout(environment: Mapping[str, str], folders: Iterable[Path]) -> str | None:
    """Return the reason why files here may be those of strangers, as a clause; None: there is no sign of it.

    The checkouts around `folders` count, and those in the workspace of the job, whose files a scenario may name.
    """
    if environment.get("GITHUB_REF", "").startswith("refs/pull/"):
        return f"the workflow runs for a pull request ({shown(environment['GITHUB_REF'])})"
    workspace = environment.get("GITHUB_WORKSPACE", "")
    around = list(_around((*folders, *([Path(workspace)] if workspace else []))))
    for git in dict.fromkeys((*around, *(_below(Path(workspace)) if workspace else ()))):
        repository = _Repository.at(git)
        if repository is None:
            continue
        # Dependencies that are checked out below may have another owner; submodules are pinned by their parent.
        is_tested = git in around and not repository.is_pinned
        found = _sign_of_pull_request(repository, environment)
        if found is None and is_tested:
            found = _sign_of_others(repository, environment)
        if found is not None:
            return f"the checkout in {escaped_line(str(git.parent))} {found}"
    return None


def _sign_of_pull_request(repository: _Repository, environment: Mapping[str, str]) -> str | None:
    for line in repository.fetched():
        if (ref := _PULL.search(line)) is not None:
            return f"is of a pull request (FETCH_HEAD names {ref[0]})"
    if re.search(r"^\s*merge\s*=\s*\"?refs/pull/", repository.config(), re.MULTILINE):
        return "is of a pull request (a branch in its configuration follows one)"
    # A self-hosted runner keeps the refs of earlier jobs: they mean nothing if the commit of the event is checked out.
    own = environment.get("GITHUB_SHA", "")
    if (not own or repository.head() != own) and (name := repository.pull_ref()) is not None:
        return f"is of a pull request ({shown(name)})"
    return None


def _sign_of_others(repository: _Repository, environment: Mapping[str, str]) -> str | None:
    fetched = (found[1] or found[2] for line in repository.fetched() if (found := _FETCHED_FROM.search(line)))
    for address in (repository.origin(), *fetched):
        if (other := _other_owner(address, environment)) is not None:
            return other
    own = environment.get("GITHUB_SHA", "")
    if environment.get("GITHUB_EVENT_NAME") == _OWN_COMMIT_ONLY and own and repository.head() != own:
        return f"is not of the commit {own[:7]} of the event, and may be of a pull request"
    return None


def _other_owner(address: str | None, environment: Mapping[str, str]) -> str | None:
    owner = environment.get("GITHUB_REPOSITORY_OWNER") or environment.get("GITHUB_REPOSITORY", "").partition("/")[0]
    found = _owner(address or "")
    if not owner or found is None or found.lower() == owner.lower():
        return None
    return f"is of a repository of {shown(found)}, not of {shown(owner)}"


def _owner(address: str) -> str | None:
    """Return the owner in the address of a repository; None: it is a path."""
    if "://" in address:
        parts = urlsplit(address)
        path = parts.path if parts.netloc else ""
    else:
        match = _SCP.fullmatch(address) if not address.startswith((".", "/")) else None
        # As FETCH_HEAD shortens an address.
        path = match["path"] if match else ""
    steps = [step for step in path.split("/") if step]
    return steps[-2] if len(steps) > 1 else None


def _around(folders: Iterable[Path]) -> Iterator[Path]:
    """Yield the nearest `.git` of each folder, and those above it."""
    for folder in folders:
        here = Path(os.path.abspath(folder))  # noqa: PTH100 - links are not followed
        for place in {here: None, Path(os.path.realpath(here)): None}:
            yield from (step / ".git" for step in (place, *place.parents) if (step / ".git").exists())


def _below(workspace: Path) -> Iterator[Path]:
    """Yield each `.git` in a workspace, as deep as `path:` of actions/checkout usually is."""
    waiting, seen = [(workspace, 0)], 0
    while waiting:
        folder, depth = waiting.pop()
        try:
            with os.scandir(folder) as entries:
                found = list(entries)
        except OSError:
            continue
        for entry in found:
            if entry.name == ".git":
                yield Path(entry.path)
            elif depth < _MAX_DEPTH and seen < _MAX_FOLDERS and entry.is_dir(follow_symlinks=False):
                seen += 1
                waiting.append((Path(entry.path), depth + 1))


def _walked(folder: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    for number, found in enumerate(os.walk(folder)):
        if number >= _MAX_REFS:
            return
        yield found


def _text(path: Path, most: int) -> str:
    try:
        data = read_at_most(path, most)
    except (OSError, ValueError):
        return ""
    return "" if data is None else data.decode("utf-8", errors="replace")
