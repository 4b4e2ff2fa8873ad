"""Find out whether a checkout may hold files of strangers: a pull request, or a repository of another owner.

Only files of `.git` are read; git does not run. actions/checkout leaves these traces: the ref of a pull request in
refs/remotes/pull (loose or packed), the place of the last fetch in FETCH_HEAD, and the address of the repository in
remote.origin.url. `gh pr checkout` leaves a branch that follows a pull request or the repository of another owner.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, shown

_MAX_BYTES: Final = 50_000_000  # of packed-refs
_MAX_LINK_BYTES: Final = 10_000
_MAX_DEPTH: Final = 2  # of `path:` of actions/checkout, below the workspace of the job
_MAX_FOLDERS: Final = 2_000
_MAX_REFS: Final = 10_000
_BLANKS: Final = " \t\r\n"
_COMMIT: Final = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_REF: Final = re.compile(r"refs/[^\x00-\x20\x7f\\:?*\[~^]+")
_PULL: Final = re.compile(r"refs/(?:remotes/(?:\w+/)?)?pull/[0-9]+/")
_MERGING: Final = ("MERGE_HEAD", "SQUASH_MSG", "CHERRY_PICK_HEAD")
# Of the configuration: [section "name"] or [section.name], and key = value.
_SECTION: Final = re.compile(
    r'[ \t]*\[[ \t]*(?P<section>[\w-]+)(?:\.(?P<dotted>[^\]"]*)|[ \t]+"(?P<name>(?:[^"\\]|\\.)*)")?[ \t]*\]'
)
_VALUE: Final = re.compile(r'[ \t]*(?P<key>[A-Za-z][\w-]*)[ \t]*=[ \t]*(?P<value>(?:[^"#;\\]|\\.|"(?:[^"\\]|\\.)*")*)')
_PUBLIC_HOSTS: Final = ("github.com", "gitlab.com", "bitbucket.org", "codeberg.org")
_FETCHED_FROM: Final = re.compile(r" of (\S+)\s*$|^[0-9a-f]+\t[^\t]*\t(\S+)\s*$")
_SCP: Final = re.compile(r"(?:[\w.-]+@)?(?P<host>[\w.-]+):(?!//)(?P<path>.+)")

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
        said = _text(self.own / "HEAD", _MAX_LINK_BYTES).strip(_BLANKS)
        name = said.removeprefix("ref:").strip(_BLANKS)
        if name == said or not _REF.fullmatch(name) or ".." in name:
            return said if _COMMIT.fullmatch(said) else ""
        loose = _text(self.common / name, _MAX_LINK_BYTES).strip()
        if loose:
            return loose if _COMMIT.fullmatch(loose) else ""
        return next((commit for commit, ref in self._packed() if ref == name), "")

    def branch(self) -> str:
        """Return the name of the branch that is checked out; an empty text if there is none."""
        said = _text(self.own / "HEAD", _MAX_LINK_BYTES).removeprefix("ref:").strip(_BLANKS)
        return said.removeprefix("refs/heads/") if said.startswith("refs/heads/") else ""

    def is_at(self, commit: str) -> bool:
        """Return True if a commit is checked out, and nothing is merged into it."""
        return bool(commit) and self.head() == commit and not any((self.own / name).exists() for name in _MERGING)

    def _commits(self) -> set[str]:
        """Return the commit that is checked out, and those on which it was built since; empty: it is not known."""
        head = self.head()
        commits = {head} if head else set()
        for line in reversed(_text(self.own / "logs/HEAD", _MAX_BYTES).split("\n") if head else ()):
            moved, _, message = line.partition("\t")
            old, new, *_ = (*moved.split(" "), "", "")
            if message.startswith("checkout:") and old != new:
                commits.add(new)
                break
            commits |= {old, new}
        return commits

    def pull_ref(self) -> str | None:
        """Return the name of a ref of a pull request that the files can be of; None: there is none.

        A self-hosted runner keeps the refs of earlier jobs. They mean nothing for other commits.
        """
        commits = self._commits()
        for commit, name in self._pull_refs():
            if not commits or commit in commits or not _COMMIT.fullmatch(commit):
                return name
        return None

    def _pull_refs(self) -> Iterator[tuple[str, str]]:
        remotes = self.common / "refs"
        for base in (remotes / "remotes", remotes / "pull"):
            for folder, _, files in _walked(base):
                for file in files:
                    name = Path(folder, file).relative_to(self.common).as_posix()
                    if _PULL.match(name):
                        yield _text(Path(folder, file), _MAX_LINK_BYTES).strip(), name
        yield from ((commit, ref) for commit, ref in self._packed() if _PULL.match(ref))

    def _packed(self) -> Iterator[tuple[str, str]]:
        for line in _text(self.common / "packed-refs", _MAX_BYTES).split("\n"):
            commit, _, ref = line.partition(" ")
            if _COMMIT.fullmatch(commit):
                yield commit, ref.strip(_BLANKS)

    def fetched(self) -> list[str]:
        """Return the lines of FETCH_HEAD: the last fetch."""
        return _text(self.own / "FETCH_HEAD", _MAX_BYTES).splitlines()

    def config(self) -> dict[tuple[str, str, str], list[str]]:
        """Return the values of the configuration by section, name of the section, and key."""
        values: dict[tuple[str, str, str], list[str]] = {}
        section = name = ""
        for line in re.sub(r"\\\r?\n", "", _text(self.common / "config", _MAX_BYTES)).split("\n"):
            start = 0
            if found := _SECTION.match(line):
                section, start = found["section"].lower(), found.end()
                name = (found["dotted"] or "").lower() if found["name"] is None else _unescaped(found["name"])
            if pair := _VALUE.match(line, start):
                values.setdefault((section, name, pair["key"].lower()), []).append(_unescaped(pair["value"].rstrip()))
        return values

    def origin(self) -> list[str]:
        """Return the address of the remote `origin`, if there is one. git fetches from the first."""
        return self.config().get(("remote", "origin", "url"), [])[:1]

    def remote_of_branch(self) -> Iterator[str]:
        """Yield the address of the remote of the branch that is checked out."""
        config = self.config()
        for remote in config.get(("branch", self.branch(), "remote"), ())[-1:]:
            yield from config.get(("remote", remote, "url"), [remote])[:1]

    def follows_pull_request(self) -> bool:
        """Return True if a branch is configured to follow a pull request."""
        return any(
            section == "branch" and key == "merge" and value.startswith("refs/pull/")
            for (section, _, key), values in self.config().items()
            for value in values
        )


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
        # The commit decides: other fetches mean nothing if that of the event is checked out.
        is_of_event = repository.is_at(environment.get("GITHUB_SHA", ""))
        found = None if is_of_event else _sign_of_pull_request(repository)
        if found is None and is_tested:
            found = _sign_of_others(repository, environment, is_of_event)
        if found is not None:
            return f"the checkout in {escaped_line(str(git.parent))} {found}"
    return None


def _sign_of_pull_request(repository: _Repository) -> str | None:
    for line in repository.fetched():
        if (ref := _PULL.search(line)) is not None:
            return f"is of a pull request (FETCH_HEAD names {ref[0]})"
    if repository.follows_pull_request():
        return "is of a pull request (a branch in its configuration follows one)"
    if (name := repository.pull_ref()) is not None:
        return f"is of a pull request ({shown(name)})"
    return None


def _sign_of_others(repository: _Repository, environment: Mapping[str, str], is_of_event: bool) -> str | None:
    addresses = repository.origin()
    if not is_of_event:
        addresses += repository.remote_of_branch()
        addresses += (found[1] or found[2] for line in repository.fetched() if (found := _FETCHED_FROM.search(line)))
    for address in addresses:
        if (other := _other_owner(address, environment)) is not None:
            return other
    own = environment.get("GITHUB_SHA", "")
    if environment.get("GITHUB_EVENT_NAME") == _OWN_COMMIT_ONLY and own and not is_of_event:
        return f"is not of the commit {own[:7]} of the event, and may be of a pull request"
    return None


def _other_owner(address: str, environment: Mapping[str, str]) -> str | None:
    owner = environment.get("GITHUB_REPOSITORY_OWNER") or environment.get("GITHUB_REPOSITORY", "").partition("/")[0]
    host, found = _host_and_owner(address)
    server, _ = _host_and_owner(environment.get("GITHUB_SERVER_URL", ""))
    # Elsewhere, such as in a mirror, the path does not say who owns a repository.
    hosts = {server, *_PUBLIC_HOSTS} - {""}
    is_known = any(host == known or host.endswith(f".{known}") for known in hosts)
    if not owner or not found or not is_known or found.lower() == owner.lower():
        return None
    return f"is of a repository of {shown(found)}, not of {shown(owner)}"


def _host_and_owner(address: str) -> tuple[str, str]:
    """Return the host and the owner in the address of a repository; empty texts where there is none, as in a path."""
    if "://" in address:
        try:
            parts = urlsplit(address)
            host, path = parts.hostname or "", parts.path
        except ValueError:  # brackets
            return "", ""
    else:
        match = _SCP.fullmatch(address) if not address.startswith((".", "/")) else None
        # As FETCH_HEAD shortens an address.
        host, path = (match["host"], match["path"]) if match else ("", "")
    steps = [step for step in path.split("/") if step]
    return host.lower().rstrip("."), steps[-2] if len(steps) > 1 else ""


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)|\"", lambda found: found[1] or "", text)


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
