"""The permissions that the caller gives, and the gate for code of the repository.

Code of the repository is everything that can run a command of its author: controllers (`script`, `process`, `policy`),
assertion classes, parts of installed packages, xacro, and nodes, launch files and tests of ROS 1. All
subcommands that run it ask this module.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, Literal
from urllib.parse import urlsplit

from sim_action.core.errors import UsageError
from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, shown

AllowScripts = Literal["auto", "true", "false"]

PRIVILEGED_BY_REASON: Final[Mapping[str, tuple[str, ...]]] = {
    "it has the rights of the base branch, and works on a pull request": ("pull_request_target", "workflow_run"),
    "strangers trigger it, and it has the rights of the default branch": (
        *("issue_comment", "issues", "discussion", "discussion_comment", "fork", "gollum", "watch"),
    ),
    "an app triggers it for a commit, which may belong to a pull request": (
        *("check_run", "check_suite", "deployment", "deployment_status", "status"),
    ),
}
"""Reason -> events of GitHub workflows on which code of the repository is not run with `auto`.

These events need the right to write to the repository, or run with the rights of a fork, and are not in the table:
`push`, `schedule`, `merge_group`, `release`, `workflow_dispatch`, `repository_dispatch`, `pull_request`. All of them
except `pull_request` are refused if the checkout is of a pull request or a fork; so are `pull_request_review` and
`pull_request_review_comment`, whose default checkout is of a pull request.
"""

PRIVILEGED_EVENTS: Final = frozenset(event for events in PRIVILEGED_BY_REASON.values() for event in events)

_FORK_EVENT: Final = "pull_request"
"""The event that has no secrets and may not write if the pull request comes from a fork."""

_REMEDY: Final = (
    "run simulations on pull_request, or set allow-scripts to true (--allow-scripts true) if all files here can be "
    "trusted"
)
_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True, slots=True)
class Permissions:
    """The permissions that the caller gives."""

    outside: bool = False  # True if files may be outside the workspace
    scripts_refused: str | None = None  # the reason why code of the repository is not run; None: it is run
    # the reason why parts of installed packages are not imported, although nothing is run; None: `scripts_refused`
    # decides
    imports_refused: str | None = None
    updates_golden: bool = False  # True if golden trajectories are written, inside the workspace
    forces_golden: bool = False  # True if they are written from a run that did not pass, too
    # names of environment variables that code of the repository may see, in addition to the harmless ones
    pass_env: tuple[str, ...] = ()
    # names of ROS packages with their folders, absolute and without links; they may be outside the workspace
    packages: tuple[tuple[str, str], ...] = ()

    def require_scripts(self, subject: str) -> None:
        """Raise UsageError if `subject`, which is code of the repository, is not run here."""
        if self.scripts_refused is not None:
            raise UsageError(f"{subject}: {self.scripts_refused}")


def scripts_refused(choice: AllowScripts, environment: Mapping[str, str], folders: Iterable[Path] = ()) -> str | None:
    """Return the reason why code of the repository is not run here, in one line; None: it is run.

    `auto` depends on the event of the GitHub workflow, and on the checkouts around `folders`, which are the folders of
    the files that may run code.
    """
    if choice == "false":
        return "scripts are not allowed to run here (allow-scripts is false)"
    event = environment.get("GITHUB_EVENT_NAME", "")
    if choice == "true" or event in ("", _FORK_EVENT):
        return None
    if event in PRIVILEGED_EVENTS:
        return (
            f"scripts are not run on {event}: a pull request from a fork could run code with the secrets of this "
            f"repository; {_REMEDY}"
        )
    if (reason := foreign_checkout(environment, folders)) is not None:
        return f"scripts are not run on {event} here, because {reason}; {_REMEDY}"
    return None


def checked_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of environment variables, sorted, each once. Raise UsageError for one that cannot be a name."""
    for name in names:
        if not _VARIABLE.fullmatch(name):
            raise UsageError(
                f"--pass-env takes the name of an environment variable, such as API_URL; found {shown(name)}"
            )
    return tuple(sorted(set(names)))


def package_folders(named: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the names of ROS packages with their folders, absolute and without links. Raise UsageError."""
    folders = {}
    for name, folder in named.items():
        try:
            place = Path(folder).resolve() if folder else None
            is_folder = place is not None and place.is_dir()
        except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, links in a circle
            place = Path(folder)
            is_folder = False
        if place is None or not is_folder or not name.isprintable() or "/" in name:
            where = f"looked for {place}" if folder else "it is empty"
            reason = "the name of a package has no slash" if "/" in name else f"there is no such folder ({where})"
            raise UsageError(escaped_line(f"--package {name}={folder}: {reason}; name a folder that is checked out"))
        folders[name] = str(place)
    return tuple(folders.items())


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
# Messages of the log of HEAD for commits that this checkout has made itself; a cherry-pick copies one of others.
_MADE_HERE: Final = re.compile(r"commit(?: \((?:amend|initial|merge)\))?: |revert: |(?:merge|pull)\b.*: Merge made by ")
_MERGED_COMMIT: Final = re.compile(r"^(?:commit )?([0-9a-f]{40}(?:[0-9a-f]{24})?)\s*$", re.MULTILINE)
_BY_FETCH_HEAD: Final = re.compile(r"(?:to|merge) FETCH_HEAD\b")
_MAX_COMMITS: Final = 1_000  # of the job itself
_NO_BRANCH: Final = re.compile(r"\bpull/[0-9]+/|^\+?[0-9a-f]{40,64}:")  # sources of a fetch
_FETCHED_TAG: Final = re.compile(r"\ttag '([^']+)' of ")
_FETCHED_FROM: Final = re.compile(r" of (\S+)\s*$|^[0-9a-f]+\t[^\t]*\t(\S+)\s*$")
_SCP: Final = re.compile(r"(?:[\w.-]+@)?(?P<host>[\w.-]+):(?!//)(?P<path>.+)")

_OWN_COMMIT_ONLY: Final = "repository_dispatch"
"""The event that other workflows send on behalf of strangers, such as after a comment on a pull request.

A pull request that is checked out by its commit leaves no other trace.
"""


@dataclass(frozen=True, slots=True)
class _Repository:
    """The folder that a `.git` stands for."""

    own: Path  # the folder of HEAD and FETCH_HEAD
    common: Path  # the folder of refs and config; worktrees of one repository share it
    is_pinned: bool = False  # True for a submodule: another repository holds its commit

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

    def is_known(self, root: Path, environment: Mapping[str, str], workspace: Path) -> bool:
        """Return True if all commits in the history of the files are of the repository, or were made in this checkout.

        The commit of the event, branches and tags are of the repository. A merge in progress counts. git, which must
        not be in `workspace`, is asked only if the refs alone do not answer.
        """
        merged = (_text(self.own / name, _MAX_BYTES) for name in _MERGING)
        heads = {self.head() or "HEAD", *(commit for text in merged for commit in _MERGED_COMMIT.findall(text))}
        refs, event = self._own_refs(environment), {environment.get("GITHUB_SHA", "")} - {""}
        if heads <= refs | event:
            return True
        from sim_action.core.git_tree import GitError, GitListing  # rarely needed

        # A checkout need not contain the commit of the event.
        for excluded in (refs | event, refs) if event else (refs,):
            words = ("rev-list", f"--max-count={_MAX_COMMITS}", *sorted(heads), "--not", *sorted(excluded), "--")
            with suppress(GitError):
                left = GitListing(root, workspace, words).output().decode().split()
                return len(left) < _MAX_COMMITS and self._made_here().issuperset(left)
        return False

    def _made_here(self) -> set[str]:
        logs = (_text(folder / "logs/HEAD", _MAX_BYTES) for folder in {self.own, self.common})
        moves = (line.partition("\t") for text in logs for line in text.split("\n"))
        return {move.split(" ")[1] for move, _, message in moves if _MADE_HERE.match(message)}

    def _own_refs(self, environment: Mapping[str, str]) -> set[str]:
        """Return the commits of branches and tags that were fetched from repositories of the owner of the workflow.

        Tags have no logs. A tag counts if it came with the clone, or if the last fetch names it.
        """
        config = self.config()
        own = set()
        addresses = {key[1]: values[0] for key, values in config.items() if key[0] == "remote" and key[2] == "url"}
        strange = {name for name, address in addresses.items() if _other_owner(address, environment) is not None}
        pulled = [
            target.rstrip("*")
            for (section, _, key), values in config.items()
            if section == "remote" and key == "fetch"
            for source, _, target in (value.lstrip("+").partition(":") for value in values)
            if not source.startswith(("refs/heads/", "refs/tags/"))
        ]
        came = {name for _, name in self._packed()}
        came |= {f"refs/tags/{tag}" for line in self.fetched() for tag in _FETCHED_TAG.findall(line)}
        for commit, name in self._refs():
            remote = next(
                (remote_name for remote_name in addresses if name.startswith(f"refs/remotes/{remote_name}/")), None
            )
            is_tag = name.startswith("refs/tags/")
            is_own = (not strange and name in came) if is_tag else (remote is not None and remote not in strange)
            is_pulled = any(target and name.startswith(target) for target in pulled) or _PULL.match(name)
            if is_own and not is_pulled and _COMMIT.fullmatch(commit) and not self._is_foreign_ref(name, environment):
                own.add(commit)
        return own

    def _is_foreign_ref(self, name: str, environment: Mapping[str, str]) -> bool:
        """Return True if the last fetch into a ref named a pull request, a bare commit, or another owner."""
        words = _text(self.common / "logs" / name, _MAX_BYTES).rstrip().rpartition("\n")[2].replace("'", " ").split()
        return any(_NO_BRANCH.search(word) or _other_owner(word, environment) is not None for word in words)

    def _commits(self) -> set[str]:
        """Return the commit that is checked out, and those on which it was built since; empty: it is not known."""
        head = self.head()
        commits = {head} if head else set()
        for old, new, message in self._moves() if head else ():
            commits |= {new} if message.startswith("checkout:") and old != new else {old, new}
        return commits

    def _moves(self) -> Iterator[tuple[str, str, str]]:
        """Yield old commit, new commit and message of the log of HEAD, back to the last checkout of another commit."""
        for line in reversed(_text(self.own / "logs/HEAD", _MAX_BYTES).split("\n")):
            moved, _, message = line.partition("\t")
            old, new, *_ = (*moved.split(" "), "", "")
            yield old, new, message
            if message.startswith("checkout:") and old != new:
                return

    def pull_fetched(self) -> str | None:
        """Return the sign of a fetch of a pull request that the files can be of, in any worktree; None: there is none.

        A commit that came by FETCH_HEAD must still be named there: a later fetch replaces the file.
        """
        commits = self._commits()
        folders = {self.common, *(path.parent for path in self.common.glob("worktrees/*/FETCH_HEAD"))} - {self.own}
        others = [line for folder in folders for line in _text(folder / "FETCH_HEAD", _MAX_BYTES).splitlines()]
        shared = [line for line in others if line.partition("\t")[0] in commits]
        for line in (*self.fetched(), *shared):
            if (ref := _PULL.search(line)) is not None:
                return f"is of a pull request (FETCH_HEAD names {ref[0]})"
        named = {line.partition("\t")[0] for line in (*self.fetched(), *others)}
        for _, new, message in self._moves():
            if _BY_FETCH_HEAD.search(message) and new not in named:
                return "may be of a pull request (it is from a FETCH_HEAD that a later fetch has replaced)"
        return None

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
        yield from ((commit, name) for commit, name in self._refs() if _PULL.match(name))

    def _refs(self) -> Iterator[tuple[str, str]]:
        """Yield all refs with their commits, apart from branches. A packed one that a loose one hides is left out."""
        loose = set()
        for base in ("remotes", "pull", "tags"):
            for folder, _, files in _walked(self.common / "refs" / base):
                for file in files:
                    name = Path(folder, file).relative_to(self.common).as_posix()
                    loose.add(name)
                    yield _text(Path(folder, file), _MAX_LINK_BYTES).strip(), name
        yield from ((commit, name) for commit, name in self._packed() if name not in loose)

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
            if header := _SECTION.match(line):
                section = header["section"].lower()
                start = header.end()
                name = (header["dotted"] or "").lower() if header["name"] is None else _unescaped(header["name"])
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
    """Return the reason why files here may come from strangers, as a clause; None: there is no sign of it.

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
        # The commit decides: other fetches mean nothing if the commit of the event is checked out.
        is_of_event = repository.is_at(environment.get("GITHUB_SHA", ""))
        sign = None if is_of_event else _sign_of_pull_request(repository)
        if sign is None and is_tested:
            sign = _sign_of_others(repository, environment, is_of_event)
        if sign is None and not is_of_event and not repository.is_pinned:
            is_dependency = git not in around and _is_dependency(repository, environment)
            if not is_dependency and not repository.is_known(git.parent, environment, Path(workspace or git.parent)):
                sign = (
                    f"may be of a pull request: {repository.head()[:7] or 'HEAD'} is neither the commit of the event, "
                    "nor of a branch or tag of the repository, nor made on top of one"
                )
        if sign is not None:
            return f"the checkout in {escaped_line(str(git.parent))} {sign}"
    return None


def _is_dependency(repository: _Repository, environment: Mapping[str, str]) -> bool:
    """Return True if a checkout is of another repository than the workflow, by the address of its origin."""
    own = environment.get("GITHUB_REPOSITORY", "").lower()
    for address in repository.origin():
        host, _ = _host_and_owner(address)
        path = address.lower().rstrip("/").removesuffix(".git").replace(":", "/")
        return bool(host) and bool(own) and not path.endswith(f"/{own}")
    return False


def _sign_of_pull_request(repository: _Repository) -> str | None:
    if (fetch := repository.pull_fetched()) is not None:
        return fetch
    if repository.follows_pull_request():
        return "is of a pull request (a branch in its configuration follows one)"
    if (name := repository.pull_ref()) is not None:
        return f"is of a pull request ({shown(name)})"
    return None


def _sign_of_others(repository: _Repository, environment: Mapping[str, str], is_of_event: bool) -> str | None:
    addresses = repository.origin()
    if not is_of_event:
        addresses += repository.remote_of_branch()
        addresses += (match[1] or match[2] for line in repository.fetched() if (match := _FETCHED_FROM.search(line)))
    for address in addresses:
        if (other := _other_owner(address, environment)) is not None:
            return other
    own = environment.get("GITHUB_SHA", "")
    if environment.get("GITHUB_EVENT_NAME") == _OWN_COMMIT_ONLY and own and not is_of_event:
        return f"is not of the commit {own[:7]} of the event, and may be of a pull request"
    return None


def _other_owner(address: str, environment: Mapping[str, str]) -> str | None:
    owner = environment.get("GITHUB_REPOSITORY_OWNER") or environment.get("GITHUB_REPOSITORY", "").partition("/")[0]
    host, address_owner = _host_and_owner(address)
    server, _ = _host_and_owner(environment.get("GITHUB_SERVER_URL", ""))
    # Elsewhere, such as in a mirror, the path does not say who owns a repository.
    hosts = {server, *_PUBLIC_HOSTS} - {""}
    is_known = any(host == known_host or host.endswith(f".{known_host}") for known_host in hosts)
    if not owner or not address_owner or not is_known or address_owner.lower() == owner.lower():
        return None
    return f"is of a repository of {shown(address_owner)}, not of {shown(owner)}"


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
    return re.sub(r"\\(.)|\"", lambda match: match[1] or "", text)


def _around(folders: Iterable[Path]) -> Iterator[Path]:
    """Yield the nearest `.git` of each folder, and those above it."""
    for folder in folders:
        absolute = Path(os.path.abspath(folder))  # noqa: PTH100 - links are not followed
        for place in {absolute: None, Path(os.path.realpath(absolute)): None}:
            yield from (step / ".git" for step in (place, *place.parents) if (step / ".git").exists())


def _below(workspace: Path) -> Iterator[Path]:
    """Yield each `.git` in a workspace, as deep as `path:` of actions/checkout usually is."""
    waiting = [(workspace, 0)]
    seen = 0
    while waiting:
        folder, depth = waiting.pop()
        try:
            with os.scandir(folder) as entries:
                children = list(entries)
        except OSError:
            continue
        for entry in children:
            if entry.name == ".git":
                yield Path(entry.path)
            elif depth < _MAX_DEPTH and seen < _MAX_FOLDERS and entry.is_dir(follow_symlinks=False):
                seen += 1
                waiting.append((Path(entry.path), depth + 1))


def _walked(folder: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    for number, listing in enumerate(os.walk(folder)):
        if number >= _MAX_REFS:
            return
        yield listing


def _text(path: Path, most: int) -> str:
    try:
        data = read_at_most(path, most)
    except (OSError, ValueError):
        return ""
    return "" if data is None else data.decode("utf-8", errors="replace")
