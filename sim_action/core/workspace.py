"""The workspace of a scenario: the files that it may read and write."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path, PurePath
from typing import Final

from sim_action.core.errors import UsageError
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


def path_problem(error: Exception, wanted: str = "file") -> str:
    """Return the reason why a path cannot be resolved: a loop of links (RuntimeError), its length, or a NUL."""
    if isinstance(error, FileNotFoundError) and error.filename is None:
        return _REMOVED
    return f"a link leads to itself; replace it with a {wanted}" if isinstance(error, RuntimeError) else str(error)


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
        here = Path.cwd()
        repository = next((folder for folder in (named, *named.parents) if (folder / ".git").exists()), None)
        place = repository or (here if named.is_relative_to(here) else named)
        root, file = place.resolve(), scenario_file.resolve()
        if not permissions.outside:
            left: Path | None = root
            if file.is_relative_to(root):
                left = next(_left_folders(place, root, here), None) if root != place else None
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
        found, is_folder = self._found(path)
        if is_folder:
            raise PathError(f"'{path}' is a folder, not a file (looked for {found})")
        return found

    def file_or_folder(self, path: str) -> Path:
        """Return the absolute path of a file or folder that a scenario names. Raise PathError."""
        return self._found(path)[0]

    def refusal(self, found: Path) -> str | None:
        """Return why a file, whose links are resolved, may not be read, to continue its name; None: it may."""
        if not found.is_relative_to(self.root):
            for _, folder in self.packages:
                if found.is_relative_to(folder) and not is_of_git(found.relative_to(folder)):
                    return None
            return None if self.allow_outside else f"is outside the workspace {self.root}"
        if is_of_git(found.relative_to(self.root)):
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

    def _found(self, path: str) -> tuple[Path, bool]:
        """Return the absolute path, and True if it is a folder."""
        try:
            found = (self.directory / path).resolve()
            is_file, is_folder = found.is_file(), found.is_dir()
        except (OSError, ValueError, RuntimeError) as error:  # too long, a NUL in it, links in a circle
            raise PathError(f"{path!r} is not a valid path: {path_problem(error)}") from None
        if refusal := self.refusal(found):
            remedy = "name another file" if found.is_relative_to(self.root) else OUTSIDE_REMEDY
            raise PathError(f"'{path}' {refusal}; {remedy}")
        if not is_file and not is_folder:
            reason = "is not a regular file" if found.exists() else "does not exist"
            raise PathError(f"'{path}' {reason} (looked for {found})")
        return found, is_folder


def _left_folders(place: Path, root: Path, here: Path) -> Iterator[Path]:
    """Yield the folders that a link leaves on the way to `place`, whose real path is `root`.

    These are repositories, the current folder `here` and the workspace of the job. A link above them does not matter,
    nor one to the repository of the current folder.
    """
    workspace = os.environ.get("GITHUB_WORKSPACE", "")
    job = Path(os.path.realpath(workspace)) if workspace else here
    for folder in place.parents:
        real = folder.resolve()
        is_bound = real in (here, job) or (folder / ".git").exists()
        if is_bound and not root.is_relative_to(real) and (real.is_relative_to(root) or not here.is_relative_to(root)):
            yield real
