"""The workspace of a scenario, the files that it may read and write; and the discovery of scenario files.

Discovery leads from typed names, folders and globs to files. It enters no link out of a workspace.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path, PurePath
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.files import open_regular
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass
from sim_action.core.wording import nearest


def is_of_git(path: PurePath) -> bool:
    """Return True if a path leads into a folder of git; some systems do not distinguish `.git` and `.GIT`."""
    return any(part.casefold() == ".git" for part in path.parts)


OUTSIDE_REMEDY: Final = (
    "allow it with --allow-outside (in the action: move it into the repository, or name its package with the input "
    "packages)"
)
"""The end of a message about a file outside the workspace."""


class PathError(ValueError):
    """A path that leads to no file, or out of the workspace."""


def path_problem(error: Exception, kind: str = "file") -> str:
    """Return the reason why a path cannot be resolved: a loop of links (RuntimeError), its length, or a NUL."""
    if isinstance(error, FileNotFoundError) and error.filename is None:
        return _REMOVED
    return f"a link leads to itself; replace it with a {kind}" if isinstance(error, RuntimeError) else str(error)


_REMOVED: Final = "the current folder does not exist any more"


def current_folder() -> Path:
    """Return the current folder. Raise UsageError if it has been removed."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        raise UsageError(_REMOVED) from None


_MAX_NAMES_READ: Final = 10_000
_NO_PERMISSIONS: Final = Permissions()


def similar_name(path: Path, suffixes: tuple[str, ...] = ("",)) -> str:
    """Return the hint "; did you mean ..." with a similar name in the folder of a missing file, in any letter case."""
    try:
        with os.scandir(path.parent) as entries:
            names = {entry.name.lower(): entry.name for entry in islice(entries, _MAX_NAMES_READ)}
    except (OSError, ValueError):  # too long, or a NUL in it
        return ""
    near = nearest(path.name.lower(), sorted(name for name in names if name.endswith(suffixes)))
    return "" if near is None or names[near] == path.name else f"; did you mean '{names[near]}'?"


@dataclass(frozen=True, slots=True)
class Workspace:
    """The folders of one scenario."""

    directory: Path  # the folder of the scenario file; relative paths start here
    root: Path  # files outside this folder are refused, unless `allow_outside` is set
    allow_outside: bool = False
    updates_golden: bool = False  # True if golden trajectories are written instead of compared
    # names of environment variables that code of the scenario may see, in addition to the harmless ones
    pass_env: tuple[str, ...] = ()
    # names of ROS packages that the caller provides, with their folders, absolute and without links; files below them
    # may be read
    packages: tuple[tuple[str, str], ...] = ()
    forces_golden: bool = False  # True if they are written from a run that did not pass, too

    @classmethod
    def around(cls, scenario_file: Path, permissions: Permissions = _NO_PERMISSIONS) -> Workspace:
        """Return the workspace of a scenario: its repository, else the current, else its folder. Raise PathError."""
        named = Path(os.path.abspath(scenario_file)).parent  # noqa: PTH100 - links are not followed
        working_folder = Path.cwd()
        repository = next((folder for folder in (named, *named.parents) if (folder / ".git").exists()), None)
        place = repository or (working_folder if named.is_relative_to(working_folder) else named)
        root = place.resolve()
        file = scenario_file.resolve()
        if not permissions.outside:
            left: Path | None = root
            if file.is_relative_to(root):
                left = next(_left_folders(place, root, working_folder), None) if root != place else None
            if left is not None:
                raise PathError(f"is a link to {file}, outside the workspace {left}; {OUTSIDE_REMEDY}")
        return cls(
            file.parent,
            root,
            permissions.outside,
            permissions.updates_golden,
            permissions.pass_env,
            permissions.packages,
            permissions.forces_golden,
        )

    def file(self, path: str) -> Path:
        """Return the absolute path of a file that a scenario names. Raise PathError."""
        resolved, is_folder = self._resolved(path)
        if is_folder:
            raise PathError(f"'{path}' is a folder, not a file (looked for {resolved})")
        return resolved

    def file_or_folder(self, path: str) -> Path:
        """Return the absolute path of a file or folder that a scenario names. Raise PathError."""
        return self._resolved(path)[0]

    def refusal(self, file: Path) -> str | None:
        """Return why a file, whose links are resolved, may not be read, to continue its name; None: it may."""
        if not file.is_relative_to(self.root):
            for _, folder in self.packages:
                if file.is_relative_to(folder) and not is_of_git(file.relative_to(folder)):
                    return None
            return None if self.allow_outside else f"is outside the workspace {self.root}"
        if is_of_git(file.relative_to(self.root)):
            return f"is in the folder .git of {self.root}, which can hold credentials and is never read"
        return None

    def new_file(self, path: str) -> Path:
        """Return the absolute path of a file to write, inside the root and not behind a link. Raise PathError."""
        if not path.isprintable():
            raise PathError(f"{path!r} is not a valid path")
        new = Path(os.path.normpath(self.directory / path))
        try:
            links = [place for place in (new, *new.parents) if place.is_relative_to(self.root) and place.is_symlink()]
            is_folder = new.is_dir()
        except OSError as error:  # too long
            raise PathError(f"{path!r} is not a valid path: {error}") from None
        if not new.is_relative_to(self.root) or is_of_git(new.relative_to(self.root)):
            raise PathError(f"'{path}' cannot be written: it is outside the workspace {self.root}")
        if links:
            raise PathError(f"'{path}' cannot be written: {links[-1]} is a link; remove it")
        if is_folder:
            raise PathError(f"'{path}' is a folder, not a file (looked for {new})")
        return new

    def may_make(self, path: str) -> bool:
        """Return True if the file does not exist and may be written."""
        try:
            return not self.new_file(path).exists()
        except PathError:
            return False

    def _resolved(self, path: str) -> tuple[Path, bool]:
        """Return the absolute path, and True if it is a folder."""
        try:
            resolved = (self.directory / path).resolve()
            is_file = resolved.is_file()
            is_folder = resolved.is_dir()
        except (OSError, ValueError, RuntimeError) as error:  # too long, a NUL in it, links in a circle
            raise PathError(f"{path!r} is not a valid path: {path_problem(error)}") from None
        if refusal := self.refusal(resolved):
            remedy = "name another file" if resolved.is_relative_to(self.root) else OUTSIDE_REMEDY
            raise PathError(f"'{path}' {refusal}; {remedy}")
        if not is_file and not is_folder:
            reason = "is not a regular file" if resolved.exists() else "does not exist"
            raise PathError(f"'{path}' {reason} (looked for {resolved})")
        return resolved, is_folder


def _left_folders(place: Path, root: Path, working_folder: Path) -> Iterator[Path]:
    """Yield the folders that a link leaves on the way to `place`, whose real path is `root`.

    These are repositories, `working_folder` and the workspace of the job. A link above them does not matter,
    nor one to the repository of the current folder.
    """
    workspace = os.environ.get("GITHUB_WORKSPACE", "")
    job = Path(os.path.realpath(workspace)) if workspace else working_folder
    for folder in place.parents:
        real = folder.resolve()
        is_bound = real in (working_folder, job) or (folder / ".git").exists()
        if (
            is_bound
            and not root.is_relative_to(real)
            and (real.is_relative_to(root) or not working_folder.is_relative_to(root))
        ):
            yield real


SUFFIXES: Final = (".sim.yml", ".sim.yaml")
_MAX_LOOKED_AT_BYTES: Final = 65_536
_KEYS: Final = (re.compile(rb"^robot[ \t]*:", re.MULTILINE), re.compile(rb"^[ \t-]*expect[ \t]*:", re.MULTILINE))
_EXTENDS: Final = re.compile(rb"^[ \t-]*extends[ \t]*:[ \t]*[\"']?([^\"'#\r\n]*[^\"'#\s])", re.MULTILINE)
_NEVER_ENTERED: Final = frozenset({"node_modules", "__pycache__", "site-packages"})


def discover(patterns: Iterable[str], *, outside: bool = False) -> dict[str, list[Path]]:
    """Return the scenario files behind each pattern, sorted.

    A folder stands for all `*.sim.yml` and `*.sim.yaml` in it and below, without hidden folders. A name without
    wildcards is a file even if it does not exist: a missing file is reported like other problems of a scenario.
    A link out of the workspace is not entered, unless `outside` is set: the link stands for itself, and is refused when
    it is read.
    """
    return {pattern: list(_matches(pattern, outside)) for pattern in patterns}


def unique(matches: Mapping[str, Iterable[Path]]) -> list[Path]:
    """Return each file once, under the name that the first matching pattern gives it."""
    first: dict[str, Path] = {}
    for files in matches.values():
        for path in files:
            first.setdefault(compared_name(str(path)), path)
    return list(first.values())


def file_name(path: PurePath) -> str:
    """Return the name that reports show for a file, the same on every system; bytes that are not UTF-8 are escaped."""
    return os.fsencode(path.as_posix()).decode("utf-8", errors="backslashreplace")


def name_beside(file: str, reference: str, path: Path) -> str:
    """Return the name of a file in messages, in the style of the file that refers to its real `path`."""
    as_written = Path(file).parent / reference
    plain = Path(os.path.normpath(as_written))
    return file_name(plain if plain.resolve() == path else as_written)


def compared_name(name: str) -> str:
    """Return one spelling for all names of a file, which need not exist: its real, absolute path."""
    try:
        return os.path.realpath(name)
    except ValueError:  # a NUL or invalid text, which no file name contains
        return name


def paths_of(pattern: str) -> list[Path]:
    """Return the path with exactly this name or, for a pattern with wildcards and no such file, all matches, sorted."""
    # A file whose name has brackets in it is that file.
    if not glob.has_magic(pattern) or os.path.lexists(pattern):
        return [Path(pattern)]
    # As in a shell, `**` inside a longer name is `*`.
    whole = PurePath(pattern)
    parts = [part if part == "**" else part.replace("**", "*") for part in whole.relative_to(whole.anchor).parts]
    # Unlike glob.glob, this follows no link to a folder for `**`: links may form cycles.
    matches = Path(whole.anchor).glob(str(PurePath(*parts)))
    return sorted(path for path in matches if _is_shown(path, parts))


def _is_shown(path: Path, parts: Iterable[str]) -> bool:
    asked = [part for part in parts if part.startswith(".")]
    return all(not part.startswith(".") or any(fnmatchcase(part, hidden) for hidden in asked) for part in path.parts)


def _matches(pattern: str, outside: bool) -> Iterator[Path]:
    for path in paths_of(pattern):
        if os.path.isdir(path):  # noqa: PTH112 - a name that is too long is no folder
            yield from _below(path) if outside or _stays_inside(path) else (path,)
        elif path == Path(pattern) or _NEVER_ENTERED.isdisjoint(path.parts):
            yield path


def _stays_inside(folder: Path) -> bool:
    """Return False for a folder behind a link out of the workspace."""
    try:
        Workspace.around(folder / "a scenario")
    except (PathError, OSError, RuntimeError):
        return False
    return True


def _below(folder: Path, suffixes: tuple[str, ...] = SUFFIXES) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _NEVER_ENTERED)
        yield from (Path(parent, name) for name in sorted(files) if name.endswith(suffixes))


def misnamed(patterns: Iterable[str], *, outside: bool = False) -> list[Path]:
    """Return the files below folders that look like scenarios, but whose names lack the ending of scenarios.

    They have the keys `robot` and `expect`. Bases are not among them: `*.base.yml`, and what another one extends.
    `outside`: True if folders behind links out of the workspace count.
    """
    texts: dict[str, bytes] = {}
    paths = [path for pattern in patterns for path in paths_of(pattern)]
    for folder in filter(os.path.isdir, paths):  # a name that is too long is no folder
        for path in _below(folder, (".yml", ".yaml")) if outside or _stays_inside(folder) else ():
            if (text := _beginning(path)) is not None:
                texts[str(path)] = text
    extended = {
        compared_name(os.path.join(os.path.dirname(name), os.fsdecode(base)))  # noqa: PTH118, PTH120 - names of any kind
        for name, text in texts.items()
        for base in _EXTENDS.findall(text)
    }
    return [
        Path(name)
        for name, text in texts.items()
        if not name.endswith((*SUFFIXES, ".base.yml", ".base.yaml"))
        and all(key.search(text) for key in _KEYS)
        and compared_name(name) not in extended
    ]


def _beginning(path: Path) -> bytes | None:
    """Return the beginning of a regular file; None if it cannot be read."""
    try:
        with open_regular(path, follow_link=False) as file:
            return file.read(_MAX_LOOKED_AT_BYTES)
    except OSError:
        return None
