"""The files of a git repository as git sees them: tracked files, and untracked ones that are not ignored.

git only lists the files, in a process of its own. It compares no contents, because that would run the filters that
`.gitattributes` names. A file with the stamps of git's index has the content that the index names; all other contents
are read here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
import subprocess
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Final

from sim_action.core.files import open_regular
from sim_action.core.process import program_on_path
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line

MISSING: Final = "missing"  # the digest of a file that does not exist
_MAX_READ_BYTES: Final = 256 << 20
_PART_BYTES: Final = 1 << 20
_CLOCK_TICK_NS: Final = 20_000_000  # Linux stamps files with a clock that may be one tick late


class FileDigests:
    """The digests of the contents of files, each read once.

    A file that was changed after `began_ns` (as `time.time_ns`) has no digest: its content at that time is not known.
    After 256 MiB of contents, the identity, the size and the time of the last change of a file count as its content.
    """

    def __init__(self, began_ns: int) -> None:
        self._oldest_change_ns = began_ns - _CLOCK_TICK_NS
        self._left = _MAX_READ_BYTES
        self._digests: dict[Path, str | None] = {}

    def of(self, path: Path) -> str | None:
        """Return the digest of a file or link, with its permission to run; None: it is not known."""
        if path not in self._digests:
            self._digests[path] = self._digest(path)
        return self._digests[path]

    def _digest(self, path: Path) -> str | None:
        try:
            status = path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            return MISSING
        except (OSError, ValueError):
            return None
        return self.of_found(path, status)

    def of_found(self, path: Path, status: os.stat_result, algorithm: str = "sha256") -> str | None:
        """Return the digest of a file or link with git's object name by `algorithm`; None if it cannot be read."""
        if _changed_ns(status) >= self._oldest_change_ns:
            return None
        try:
            if stat.S_ISLNK(status.st_mode):
                target = os.fsencode(path.readlink())
                return git_content("120000", _named([target], len(target), algorithm), len(target))
            if not stat.S_ISREG(status.st_mode):
                return f"no file {stat.S_IFMT(status.st_mode):o}"
            mode, size = "100755" if status.st_mode & stat.S_IXUSR else "100644", status.st_size
            if size > self._left:
                return f"{mode} {status.st_dev} {status.st_ino} {size} {_changed_ns(status)} {status.st_mtime_ns}"
            self._left -= size
            with open_regular(path, follow_link=False) as file:
                parts = iter(lambda: file.read(_PART_BYTES), b"")
                return git_content(mode, _named(parts, size, algorithm), size)
        except OSError:
            return None


def beginning_ns(paths: Iterable[Path]) -> int:
    """Return the present time for `FileDigests`; wait a tick if a file, or its folder, has just been changed."""
    now_ns = time.time_ns()
    changes_ns = [0]
    for path in {place for file in paths for place in (file, file.parent)}:
        with suppress(OSError, ValueError):  # a NUL in a name
            changes_ns.append(_changed_ns(path.lstat()))
    if not 0 <= now_ns - max(changes_ns) <= _CLOCK_TICK_NS:
        return now_ns
    time.sleep(1e-9 * _CLOCK_TICK_NS)
    return time.time_ns()


def git_content(mode: str, name: str, size: int) -> str:
    """Return the digest of git's object, with mode and size: filters and line ends may give one other contents."""
    return f"{mode} {name} {size}"


def _named(parts: Iterable[bytes], size: int, algorithm: str) -> str:
    """Return the object name that git gives a content."""
    digest = hashlib.new(algorithm, b"blob %d\0" % size, usedforsecurity=False)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _changed_ns(status: os.stat_result) -> int:
    return status.st_mtime_ns if sys.platform == "win32" else status.st_ctime_ns


_TIMEOUT_S: Final = 10.0
_MAX_FILES: Final = 200_000
_MAX_REPOSITORIES: Final = 100
_MAX_LINK_BYTES: Final = 4_000
_PIPE_BYTES: Final = 1 << 20
_SETTINGS: Final = ("-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null", "-c", "core.untrackedCache=false")
_ALL_FILES: Final = ("ls-files", "-z", "-t", "--stage", "--debug", "--others", "--exclude-standard")
# The tag of an untracked file; or mode, object, stage and path of a tracked one, followed by its stamps.
_ENTRY: Final = re.compile(
    rb"(?:\? ([^\0]+)|\w (\d{6}) ([0-9a-f]+) \d\t([^\0]+))\0"
    rb"(?:  ctime: (\d+):(\d+)\n  mtime: (\d+):(\d+)\n  dev: \d+\tino: (\d+)\n  uid: \d+\tgid: \d+\n"
    rb"  size: (\d+)\tflags: \w+\n)?"
)
_SUBMODULE: Final = b"160000"
_SHA1_DIGITS: Final = 40
_32_BITS: Final = 0xFFFFFFFF


class GitError(Exception):
    """The files of a repository are not known; the message is the reason."""


@dataclass(frozen=True)
class GitTree:
    """The files of a repository and of the repositories in it."""

    root: Path  # its folder
    # the path of each file, relative to the root -> a text that is equal for equal contents
    contents: Mapping[str, str]

    @cached_property
    def digest(self) -> str:
        """The SHA-256 hash of all paths and contents."""
        return hashlib.sha256(json.dumps(self.contents, sort_keys=True).encode()).hexdigest()

    def holds(self, path: Path) -> bool:
        """Return True for a file of the tree; links in `path` must be resolved."""
        name, root = path.as_posix(), self._beginning
        return name.startswith(root) and name.removeprefix(root) in self.contents

    @cached_property
    def _beginning(self) -> str:
        return f"{self.root.as_posix().rstrip('/')}/"


class GitListing:
    """A running git that lists the files of a repository."""

    def __init__(self, root: Path, outermost: Path | None = None, words: tuple[str, ...] = _ALL_FILES) -> None:
        """Start git; an error is raised by `tree`. `outermost`: the folder in which no git is started."""
        self.root = root
        self._process: subprocess.Popen[bytes] | None = None
        self._reason = "it is not the root of a git repository"
        if not (root / ".git").exists():
            return
        program = program_on_path("git", outermost or root)
        if program is None:
            self._reason = "git was not found on PATH, outside of the workspace"
            return
        try:
            # The environment of git: this repository and no other, and no transfers from other machines.
            kept = {name: value for name, value in os.environ.items() if not name.upper().startswith("GIT_")}
            self._process = subprocess.Popen(  # noqa: S603 - fixed words
                (program, *_SETTINGS, *words),
                cwd=root,
                env={
                    **kept,
                    "GIT_DIR": str(root / ".git"),
                    "GIT_WORK_TREE": str(root),
                    "GIT_OPTIONAL_LOCKS": "0",
                    "GIT_NO_LAZY_FETCH": "1",
                    "GIT_ALLOW_PROTOCOL": "none",
                    "GIT_TERMINAL_PROMPT": "0",
                },
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                # git must not wait until its answer is read.
                pipesize=_PIPE_BYTES,
            )
        except OSError as error:
            self._reason = f"git cannot be started: {error.strerror}"

    def tree(self, digests: FileDigests, excluded: Collection[Path] = ()) -> GitTree:
        """Return the files; untracked ones in or at the paths `excluded` do not count. Raise GitError."""
        without = tuple(path.relative_to(self.root).as_posix() for path in excluded if path.is_relative_to(self.root))
        contents: dict[str, str] = {}
        waiting = [(self, PurePosixPath())]
        count = 0
        while waiting:
            listing, place = waiting.pop()
            count += 1
            if count > _MAX_REPOSITORIES:
                raise GitError(f"{self.root} contains more than {_MAX_REPOSITORIES} git repositories")
            for name, content in _Reader(listing.root, listing.output(), digests, place, without).contents():
                if content is not None:
                    contents[(place / name).as_posix()] = content
                else:
                    waiting.append((GitListing(listing.root / name, self.root), place / name))
                    contents[(place / name).as_posix()] = "repository"
        return GitTree(self.root, contents)

    def output(self) -> bytes:
        """Return the list that git has printed. Raise GitError."""
        if self._process is None:
            raise GitError(f"{self.root}: {self._reason}")
        try:
            printed, _ = self._process.communicate(timeout=_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.close()
            raise GitError(f"{self.root}: git did not answer within {_TIMEOUT_S:g} s") from None
        if self._process.returncode:
            raise GitError(f"{self.root}: git cannot list its files (git exited with {self._process.returncode})")
        return printed

    def close(self) -> None:
        """End git, if its answer is not needed any more."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            self._process.communicate()


def repositories_around(path: Path) -> list[Path]:
    """Return the folders around a file that have a `.git`, with links followed and not followed."""
    named = Path(os.path.abspath(path))  # noqa: PTH100 - links are not followed
    folders = dict.fromkeys((*named.parents, *Path(os.path.realpath(path)).parents))
    return [folder for folder in folders if (folder / ".git").exists()]


def is_tracked(root: Path, path: Path) -> bool:
    """Return True if the index names a file, under any spelling. Raise GitError."""
    listing = GitListing(root, words=("ls-files", "-z", "--stage"))
    path_status = _status(path)
    name = path.name.casefold()
    inside = {folder for folder in Path(os.path.realpath(path)).parents if not (folder / ".git").exists()}
    for entry in listing.output().split(b"\0")[:-1]:
        mode, _, tracked = entry.partition(b" ")
        place = root / os.fsdecode(tracked.partition(b"\t")[2])
        if mode == _SUBMODULE and Path(os.path.realpath(place)) in inside:
            raise GitError(f"{_shown(place)} is a submodule without a repository")
        status = _status(place) if place.name.casefold() == name else None
        if status is not None and path_status is not None and os.path.samestat(status, path_status):
            return True
    return False


class _Reader:
    """Reads what git printed about one repository; `place`: its path in the outermost one."""

    def __init__(
        self, root: Path, printed: bytes, digests: FileDigests, place: PurePosixPath, excluded: Collection[str]
    ) -> None:
        self._root, self._printed, self._digests = root, printed, digests
        self._place, self._excluded = place, excluded
        self._written_ns = _index_written_ns(root)
        self._own_output = set(_files_of_output())

    def contents(self) -> Iterator[tuple[str, str | None]]:
        """Yield each path with its content; None: a repository in this one. Raise GitError."""
        end = 0
        for number, entry in enumerate(_ENTRY.finditer(self._printed), start=1):
            if entry.start() != end:
                break
            end = entry.end()
            if number > _MAX_FILES:
                raise GitError(f"{self._root} has more than {_MAX_FILES:,} files")
            untracked, mode, blob, tracked, *stamps = entry.groups()
            name = os.fsdecode(untracked or tracked)
            if untracked:
                yield from self._untracked(name)
            elif mode == _SUBMODULE:
                folder = self._root / name
                if (folder / ".git").exists():
                    yield name, None
                elif folder.is_dir() and any(folder.iterdir()):
                    raise GitError(f"{_shown(folder)} is a submodule without a repository")
                else:
                    yield name, MISSING
            else:
                yield name, self._tracked(name, mode.decode(), blob.decode(), [*map(int, filter(None, stamps))])
        if end != len(self._printed):
            raise GitError(f"{self._root}: this version of git lists files in an unknown form")

    def _untracked(self, name: str) -> Iterator[tuple[str, str | None]]:
        if name.endswith("/"):
            # A repository that is no submodule.
            if not self._is_excluded(name.rstrip("/")):
                yield name.rstrip("/"), None
            return
        # Python writes bytecode while scenarios run; it comes from the files next to it.
        if self._is_excluded(name) or "__pycache__/" in name:
            return
        status = _status(self._root / name)
        if status is None:
            yield name, MISSING
        elif (status.st_dev, status.st_ino) not in self._own_output:
            yield name, self._read(name, status)

    def _tracked(self, name: str, mode: str, blob: str, stamps: list[int]) -> str:
        status = _status(self._root / name)
        if status is None:
            return MISSING
        if stamps and self._is_unchanged(status, stamps):
            return git_content(mode, blob, status.st_size)
        return self._read(name, status, "sha1" if len(blob) == _SHA1_DIGITS else "sha256")

    def _is_unchanged(self, status: os.stat_result, stamps: list[int]) -> bool:
        """Return True if a file has the stamps of the index, and was not changed while the index was written."""
        *changed, modified_s, modified_ns, inode, size = stamps
        if stat.S_ISDIR(status.st_mode) or modified_s * 10**9 + modified_ns >= self._written_ns:
            return False
        same = [(size, status.st_size & _32_BITS), ((modified_s, modified_ns), _seconds(status.st_mtime_ns))]
        if sys.platform != "win32":
            same += [(tuple(changed), _seconds(status.st_ctime_ns)), (inode, status.st_ino & _32_BITS)]
        return all(stated == actual for stated, actual in same)

    def _read(self, name: str, status: os.stat_result, algorithm: str = "sha256") -> str:
        content = self._digests.of_found(self._root / name, status, algorithm)
        if content is None:
            raise GitError(f"{_shown(self._root / name)} was changed a moment ago, or cannot be read")
        return content

    def _is_excluded(self, name: str) -> bool:
        whole = (self._place / name).as_posix()
        return any(whole == path or whole.startswith(f"{path}/") or path == "." for path in self._excluded)


def _seconds(time_ns: int) -> tuple[int, int]:
    return (time_ns // 10**9) & _32_BITS, time_ns % 10**9


def _status(path: Path) -> os.stat_result | None:
    """Return the status of a file; None if it does not exist. Raise GitError."""
    try:
        return path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise GitError(f"{_shown(path)} cannot be read: {error.strerror}") from None


def _index_written_ns(root: Path) -> int:
    """Return the time at which git's index was written; a change in the same tick of the clock leaves no mark."""
    folder = root / ".git"
    try:
        if folder.is_file():
            with folder.open(encoding="utf-8", errors="surrogateescape") as file:
                folder = root / file.read(_MAX_LINK_BYTES).removeprefix("gitdir:").strip()
        return (folder / "index").stat().st_mtime_ns
    except (OSError, ValueError):
        return 0


def _files_of_output() -> Iterator[tuple[int, int]]:
    """Yield the files that this process prints into."""
    for descriptor in (1, 2):
        try:
            status = os.fstat(descriptor)
        except OSError:
            continue
        if stat.S_ISREG(status.st_mode):
            yield status.st_dev, status.st_ino


def _shown(path: Path) -> str:
    return escaped_line(str(path))
