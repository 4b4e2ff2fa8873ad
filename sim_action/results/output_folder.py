"""The output folder of a call: making it, locking it for one call at a time, and removing files of the earlier call.

Files that sim-action has written are recognised by their content: only these, and empty files, are overwritten.

The lock is a record lock of POSIX on a file that holds the process id. A forked child does not inherit it, and the
system releases it when the process ends in any way, so a lock is never stale. The file also takes up the space that the
results will need, so that traces and other files of runs leave it free.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from sim_action.core.errors import UsageError
from sim_action.core.files import UNFINISHED_FILE, open_regular, whole_file
from sim_action.core.wording import escaped_line, system_reason, warn
from sim_action.recording.export import EXPORTS
from sim_action.results.artifacts import RECORDING_FOLDER, REPLAY_FOLDER, REPORT_FILE, TRACE_FOLDER, stored_file
from sim_action.results.journal import JOURNAL_FILE, manifest
from sim_action.results.results_json import RESULTS_FILE

JUNIT_FILE: Final = "junit.xml"  # the default name of the JUnit XML

SUFFIXES: Final = {
    TRACE_FOLDER: (".npz",),
    REPLAY_FOLDER: (".json.gz",),
    RECORDING_FOLDER: tuple(f".{name}" for name in EXPORTS),
}
"""Folder of the files of runs -> the suffixes of the files that sim-action writes there."""

GENERATOR: Final = '<meta name="generator" content="sim-action">'  # the mark of a report in its head
COMPARED: Final = "compared with the previous run"  # the words at the beginning of a comparison as Markdown
_MAX_START_BYTES: Final = 8192

JUNIT_NAME: Final = "sim-action"
"""The name of the root of our JUnit XML, which makes it different from JUnit XML of other tools."""


def is_own_junit(start: bytes) -> bool:
    """Return True if a file with this beginning is JUnit XML of sim-action, of any version."""
    parser: Any = ET.XMLPullParser(("start",))
    # The last two: an unknown encoding. A mistake behind the first element does not matter.
    with suppress(ET.ParseError, LookupError, ValueError):
        parser.feed(start)
    with suppress(ET.ParseError):
        for _, root in parser.read_events():
            return (root.tag, root.get("name")) == ("testsuites", JUNIT_NAME)
    return False


def is_comparison(start: bytes) -> bool:
    """Return True if a file with this beginning is the Markdown of `compare`."""
    return start.startswith(b"## ") and COMPARED.encode() in start


def is_proof(start: bytes) -> bool:
    """Return True if a file with this beginning is the JSON of `prove`."""
    return start.startswith(b"{") and b'"sim_action"' in start and b'"scenarios"' in start


_KINDS: Final[dict[str, Callable[[bytes], bool]]] = {
    RESULTS_FILE: lambda start: start.startswith(b"{") and b'"sim_action"' in start,
    JOURNAL_FILE: lambda start: start.startswith(b"{") and b'"journal"' in start and b'"sim_action"' in start,
    REPORT_FILE: lambda start: GENERATOR.encode() in start,
    JUNIT_FILE: is_own_junit,
}
"""Name of a file in the output folder -> function that recognises it by its first bytes."""


def is_foreign(path: Path, is_ours: Callable[[bytes], bool]) -> bool:
    """Return True if a file has content that is not ours. Raise OSError, and UsageError for a link."""
    if path.is_symlink():
        raise UsageError(escaped_line(f"'{path}' is a link, and results are not written through links; remove it"))
    try:
        with open_regular(path, follow_link=False) as file:
            start = file.read(_MAX_START_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return bool(start) and not is_ours(start)


@contextmanager
def writing(target: str) -> Iterator[None]:
    """Raise UsageError if the system, or the name of a file, lets nothing be written inside; `target`: the file."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"{target} cannot be written: {system_reason(error)}")) from None


def refuse_foreign_file(option: str, path: Path, is_ours: Callable[[bytes], bool], what: str) -> None:
    """Raise UsageError if the file of an option exists and is not ours; `what`: that it is not, in words."""
    with writing(f"{option} {path}"):
        foreign = is_foreign(path, is_ours)
    if foreign:
        raise UsageError(escaped_line(f"{option} {path} exists and {what}; name another file, or remove it"))


def refuse_foreign_files(folder: Path) -> None:
    """Raise UsageError if a call with this output folder would overwrite a file of the user."""
    earlier = manifest(folder)
    for name, is_ours in _KINDS.items():
        if name not in earlier and is_foreign(folder / name, is_ours):
            raise _refusal(folder, name)
    if not earlier and not (folder / RESULTS_FILE).is_file():
        for name, suffixes in SUFFIXES.items():
            place = folder / name
            for path in sorted(place.iterdir()) if place.is_dir() else ():
                if path.name.endswith(suffixes):
                    raise _refusal(folder, f"{name}/{path.name}")


def _refusal(folder: Path, name: str) -> UsageError:
    return UsageError(
        escaped_line(
            f"--output-dir {folder} has a file '{name}' that sim-action did not write, and it would be overwritten; "
            "choose another folder, such as sim-results"
        )
    )


LOCK_FILE: Final = ".sim-action.lock"
"""The locked file; a name of our own, because the output folder may hold files of the user."""

_REPORT_FILES: Final = frozenset({JOURNAL_FILE, RESULTS_FILE, JUNIT_FILE, REPORT_FILE})
_OVER_QUOTA: Final = getattr(errno, "EDQUOT", errno.ENOSPC)
_DISK_FULL: Final = frozenset({errno.ENOSPC, _OVER_QUOTA})
_IN_USE: Final = frozenset({errno.EACCES, errno.EAGAIN, errno.EDEADLK})
# A network file system may have no locks.
_WITHOUT_LOCKS: Final = frozenset({errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL})

# The other call has locked the file, and writes its process id next.
_PID_TIMEOUT_S: Final = 1.0
_PID_POLL_S: Final = 0.01
_MAX_PID_BYTES: Final = 20
_LOCKED_BYTE: Final = 1 << 30  # Windows locks bytes against reading, so the locked byte is far behind the process id

# A scenario with ten assertions needs 4 to 10 kB in each of `results.json`, the JUnit XML and the journal.
_BYTES_OF_OUTCOME: Final = 24_000
_BYTES_OF_CALL: Final = 64_000
_PARTS_OF_RESERVE: Final = 16  # the journal gets this part of the reserve whenever it lacks space
# Above this, a lack of space has another cause, such as too many files, and files of runs would be lost for nothing.
_LEAST_FREE_BYTES: Final = 64_000_000

_BLOCK_BYTES: Final = 1_000_000

# A process may lock a file that it has locked already, so the folders that this process has locked are known here.
_locked: Final[set[str]] = set()


def create_folder(folder: Path) -> None:
    """Make the folder if it is missing, and let git ignore it then: others are the user's. Raise OSError."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        folder.mkdir()
    except FileExistsError:
        if not folder.is_dir():
            raise
        return
    with suppress(OSError), whole_file(folder / ".gitignore") as file:
        file.write(b"*\n")


class Room:
    """Disk space for the required files of a call: a reserve, and then the space of files of runs.

    `removed`: the names of the files that made room, and the reason of the system.
    """

    def __init__(self, folder: Path | None = None, lock: int | None = None) -> None:
        """`lock`: the descriptor of the locked file, which takes up the reserve. None: there is none."""
        self._folder, self._lock = folder, lock
        self._reserved = self._part = 0
        self.removed: dict[str, str] = {}

    def reserve(self, outcomes: int) -> None:
        """Reserve space for so many outcomes, or warn that there is none."""
        size = _BYTES_OF_CALL + outcomes * _BYTES_OF_OUTCOME
        if self._lock is not None:
            try:
                if sys.platform == "linux":
                    os.posix_fallocate(self._lock, 0, size)
                else:
                    write_zeros(self._lock, size)
            except OSError as error:
                self.release()
                if error.errno in _DISK_FULL:
                    warn(f"{self._folder} may lack space for results: {size / 1e6:.1f} MB are needed; free some space")
            else:
                self._reserved, self._part = size, size // _PARTS_OF_RESERVE

    def release(self) -> None:
        """Give back the reserve."""
        self._shrink(0)

    def make(self, error: OSError, names: Iterable[str]) -> bool:
        """Make room after an error of the system, and return False if another attempt would not help.

        A part of the reserve is given back. Without one, the largest file is removed of those `names` that belong to
        the folders of traces, replays and recordings.
        """
        if self._folder is None or error.errno not in _DISK_FULL:
            return False
        if self._reserved:
            return self._shrink(max(0, self._reserved - self._part))
        with suppress(OSError):
            if error.errno != _OVER_QUOTA and shutil.disk_usage(self._folder).free > _LEAST_FREE_BYTES:
                return False
        evidence = {name for name in names if _is_ours(name)} - _REPORT_FILES
        paths = ((name, stored_file(self._folder, name)) for name in evidence)
        sizes = {name: path.stat().st_size for name, path in paths if path is not None}
        if not sizes:
            return False
        name = max(sizes, key=lambda name: sizes[name])
        (self._folder / name).unlink()
        self.removed[name] = system_reason(error)
        warn(f"{system_reason(error)}: {name} was removed to make room for the verdicts")
        return True

    def _shrink(self, size: int) -> bool:
        if self._lock is not None:
            with suppress(OSError):
                os.ftruncate(self._lock, max(size, len(f"{os.getpid()}\n")))
        self._reserved = size
        return True


def write_zeros(descriptor: int, size: int) -> None:
    """Lengthen a file with zeros; other systems than Linux have no call for it. Raise OSError."""
    end = os.lseek(descriptor, 0, os.SEEK_END)
    while end < size:
        end += os.write(descriptor, bytes(min(_BLOCK_BYTES, size - end)))


@contextmanager
def locked(folder: Path) -> Iterator[Room]:
    """Lock a folder for this call, if the system can. Raises UsageError if another call has locked it."""
    place = os.path.realpath(folder)
    if place in _locked:
        raise _in_use(folder, str(os.getpid()))
    try:
        descriptor = _open_locked(folder)
    except OSError as error:
        if error.errno not in _DISK_FULL | _WITHOUT_LOCKS:
            raise UsageError(
                escaped_line(f"cannot write to the output folder {folder}: {system_reason(error)}")
            ) from None
        warn(f"the output folder {folder} is not locked against other runs: {system_reason(error)}")
        descriptor = None
    _locked.add(place)
    try:
        yield Room(folder, descriptor)
    finally:
        _locked.discard(place)
        if descriptor is not None:
            # Remove the file while it is locked, unless it was replaced, and release it.
            path = folder / LOCK_FILE
            with suppress(OSError):
                # Windows does not remove a file that is open.
                if _is_file_at(path, descriptor) and sys.platform != "win32":
                    path.unlink()
            with suppress(OSError):
                os.close(descriptor)


def _open_locked(folder: Path) -> int:
    """Return the descriptor of the locked file, which holds the process id. Raise OSError or UsageError."""
    path = folder / LOCK_FILE
    while True:
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        if path.is_symlink():
            raise UsageError(escaped_line(f"'{path}' is a link, and results are not written through links; remove it"))
        descriptor = os.open(path, flags, 0o666)
        status = os.fstat(descriptor)
        # Its content is replaced, which a hard link would share with another file.
        if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
            os.close(descriptor)
            raise OSError(errno.EEXIST, f"{LOCK_FILE} is not a regular file of its own; remove it")
        try:
            is_ours = _lock(descriptor)
            # The call before may have removed the file between the two lines above.
            if is_ours and _is_file_at(path, descriptor):
                # On a full disk, the lock holds without the process id.
                with suppress(OSError):
                    os.ftruncate(descriptor, 0)
                    os.write(descriptor, f"{os.getpid()}\n".encode())
                return descriptor
            pid = "" if is_ours else _pid_in(descriptor)
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)
        if not is_ours:
            raise _in_use(folder, pid)


def _lock(descriptor: int) -> bool:
    """Lock the file without waiting, and return False if another process has locked it. Raise OSError."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _IN_USE:
            return False
        raise
    return True


def _pid_in(descriptor: int) -> str:
    """Return the process id in the file; empty if there is none after a short wait."""
    patience = time.monotonic() + _PID_TIMEOUT_S
    while True:
        os.lseek(descriptor, 0, os.SEEK_SET)
        pid, end, _ = os.read(descriptor, _MAX_PID_BYTES).partition(b"\n")
        if end and pid.isdigit():
            return pid.decode()
        if time.monotonic() >= patience:
            return ""
        time.sleep(_PID_POLL_S)


def _is_file_at(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _in_use(folder: Path, pid: str) -> UsageError:
    process = f" (process {pid})" if pid else ""
    return UsageError(
        escaped_line(
            f"the output folder {folder} is in use by another run of sim-action{process}; "
            "wait for it, or choose another --output-dir"
        )
    )


def remove_earlier_files(folder: Path, names: Iterable[str]) -> None:
    """Remove the files of an earlier call, given their names relative to the folder.

    A stranger may have written the names. Only regular files are removed that sim-action may have written: reports, and
    files directly in the folders of traces, replays and recordings. Links are not followed. All else is ignored.
    """
    for name in names:
        if _is_ours(name):
            path = folder / name
            with suppress(OSError, ValueError):
                if path.parent == folder or not path.parent.is_symlink():
                    remove_regular(path)


def remove_unfinished_files(folder: Path) -> None:
    """Remove the temporary files that a killed call has left in the locked output folder."""
    for place in (folder, *(folder / name for name in SUFFIXES)):
        with suppress(OSError):
            unfinished = [path for path in place.iterdir() if UNFINISHED_FILE.fullmatch(path.name)]
            for path in unfinished if place == folder or not place.is_symlink() else ():
                remove_regular(path)


def remove_regular(path: Path) -> None:
    """Remove a regular file; anything else stays. Raise OSError or ValueError."""
    if stat.S_ISREG(os.lstat(path).st_mode):
        path.unlink()


def _is_ours(name: str) -> bool:
    """Return True if the name is one that sim-action gives to a file below the output folder."""
    if name in _REPORT_FILES:
        return True
    parent, _, file = name.partition("/")
    suffixes = SUFFIXES.get(parent, ())
    return not set(file) & set("/\\:\0") and any(file.endswith(end) and file != end for end in suffixes)
