"""The files that user code reads in the child process, as an audit hook of Python sees them.

The parent decides whether it knows their contents (see `RunKeys`). A started process or an open socket may read
anything. Files that native code opens by itself are not seen.
"""

from __future__ import annotations

import json
import os
import sys
import sysconfig
from collections.abc import Callable, Iterable
from importlib.util import source_from_cache
from pathlib import Path
from typing import Any, Final

from pydantic_core import PydanticSerializationError, to_json

from sim_action.core.files import cache_folder
from sim_action.runner.job import Job

MAX_INPUTS: Final = 2_000
"""The largest number of observed files; a run that reads more counts as one that may have read anything."""

_OURS: Final = Path(__file__).resolve().parent.parent
_PACKAGES: Final = ("site-packages", "dist-packages")
_DEVICES: Final = frozenset({"/dev/null", "/dev/zero", "/dev/urandom", "/dev/random"})
_OPENS: Final = frozenset({"open", "sqlite3.connect"})
_LISTS: Final = frozenset({"os.listdir", "os.scandir"})
_UNLIMITED: Final = frozenset(
    {
        *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.forkpty"),
        *("pty.spawn", "os.startfile", "socket.__new__"),
    }
)
# It reads the network of a policy, as the run itself does later.
_OUR_CHECK: Final = [sys.executable, "-P", "-m", "sim_action.networks.network_check"]
_READS: Final = os.O_RDONLY | os.O_WRONLY | os.O_RDWR
_EMPTIES: Final = os.O_TRUNC | os.O_EXCL


class ObservedInputs:
    """The inputs of user code here; not `is_limited`: it may have read anything, as in another process."""

    def __init__(self, job: Job, scratch: Path) -> None:
        """Take the job and its scratch folder: its own files do not count."""
        self.is_limited = True
        self._files: dict[str, None] = {}
        self._written: set[str] = set()
        self._written_in = _folders([job.loaded.workspace.root, job.results, scratch])
        folder = cache_folder("any")
        self._read_in = _folders([*python_folders(), _OURS, scratch, *([] if folder is None else [folder.parent])])
        self._listed = {os.path.abspath(folder) for folder in sys.path}  # noqa: PTH100 - no Path in an audit hook

    @property
    def files(self) -> tuple[str, ...] | None:
        """The paths of all files and folders, except files of Python and sim-action; None: it is not limited."""
        return tuple(self._files) if self.is_limited else None

    def encoded(self) -> bytes:
        """Return the files as JSON."""
        try:
            # User code may have replaced what `json` needs, and a verdict that is there must not be lost.
            return to_json(self.files)
        except PydanticSerializationError:
            # The name of a file is not UTF-8.
            return json.dumps(self.files).encode()

    def take(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Take an audit event."""
        if event in _OPENS:
            self._open(*arguments)
        elif event in _LISTS:
            path = _absolute(arguments[0] if arguments[0] is not None else ".")
            if path is not None and path not in self._listed and not _is_inside(path, self._written_in):
                self._add(path)
        elif event == "ctypes.dlopen":
            if arguments[0] is not None:
                self._open(arguments[0])
        elif event in _UNLIMITED and arguments[1:2] != (_OUR_CHECK,):
            self.is_limited = False

    def _open(self, name: Any, _mode: object = None, flags: int = os.O_RDONLY) -> None:
        path = _absolute(name)
        if path is None:
            return
        if flags & _READS == os.O_WRONLY or flags & _EMPTIES:
            if not _is_inside(path, self._written_in):
                self._add(path)
            elif flags & _EMPTIES:
                self._written.add(path)
        elif path not in self._written:
            self._add(path)

    def _add(self, path: str) -> None:
        if path in self._files or path in _DEVICES or _is_inside(path, self._read_in) or _is_of_process(path):
            return
        self._files[path] = None
        if len(self._files) > MAX_INPUTS:
            self.is_limited = False


def python_folders() -> list[Path]:
    """Return the folders of this Python and of its packages, whose names and versions are in the keys of runs."""
    stated = sysconfig.get_paths()
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    folders = [Path(stated[name]) for name in names if name in stated]
    base = Path(sys.base_prefix)
    packages = [path for path in map(Path, sys.path) if path.suffix == ".zip" or path.name in _PACKAGES]
    inside = [path for path in packages if path.is_relative_to(base) or path.is_relative_to(sys.prefix)]
    return [*folders, *inside]


def observed_inputs(job: Job, scratch: Path) -> ObservedInputs | None:
    """Observe this process from now on, if it runs user code. The audit hook of Python cannot be removed."""
    early = _Hook.early
    _Hook.early = None
    if not job.loaded.scenario.runs_user_code:
        return None
    inputs = ObservedInputs(job, scratch)
    for event, arguments in early or ():
        inputs.take(event, arguments)
    _Hook.receivers.append(inputs.take)
    _set_hook()
    return inputs


def hear_early() -> None:
    """Keep what this process reads until `observed_inputs`: to receive a job may import code of installed packages."""
    _Hook.early = []
    _set_hook()


def _set_hook() -> None:
    if not _Hook.is_set:
        _Hook.is_set = True
        sys.addaudithook(_heard)


class _Hook:
    """The state of the audit hook of this process; `early`: the events before there is a job, while they are kept."""

    is_set = False
    early: list[tuple[str, tuple[Any, ...]]] | None = None
    receivers: Final[list[Callable[[str, tuple[Any, ...]], None]]] = []


def _heard(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in _HEARD:
        return
    if _Hook.early is not None:
        _Hook.early.append((event, arguments))
    for receive in _Hook.receivers:
        try:
            receive(event, arguments)
        except Exception:  # noqa: BLE001 - it would appear in the user's code
            receive("os.fork", ())


_HEARD: Final = frozenset({*_OPENS, *_LISTS, *_UNLIMITED, "ctypes.dlopen"})


def inputs_in(written: bytes) -> tuple[str, ...] | None:
    """Return the inputs that a child process reports; None if they are not valid, or not limited."""
    try:
        inputs = json.loads(written)
    except (ValueError, RecursionError):
        return None
    is_valid = (
        isinstance(inputs, list) and len(inputs) <= MAX_INPUTS and all(isinstance(entry, str) for entry in inputs)
    )
    return tuple(inputs) if is_valid else None


def _folders(paths: Iterable[Path]) -> tuple[str, ...]:
    forms = {form for path in paths for form in (os.path.abspath(path), os.path.realpath(path))}  # noqa: PTH100
    return tuple(map(_as_folder, sorted(forms)))


def _is_inside(path: str, folders: tuple[str, ...]) -> bool:
    return _as_folder(path).startswith(folders)


def _as_folder(path: str) -> str:
    return os.path.join(path, "")  # noqa: PTH118


def _absolute(name: Any) -> str | None:
    """Return the absolute path of a file, the source file of bytecode; None for a descriptor."""
    if isinstance(name, int):
        return None
    path = os.path.abspath(os.fsdecode(name))  # noqa: PTH100 - a Path would be slow
    if path.endswith(".pyc") and "__pycache__" in path:
        try:
            return source_from_cache(path)
        except ValueError:
            return path
    return path


def _is_of_process(path: str) -> bool:
    return path.startswith(("/proc/self/", "/proc/thread-self/", f"/proc/{os.getpid()}/"))
