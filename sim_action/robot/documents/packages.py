"""Find ROS packages and Gazebo models by name, without ROS: `package://`, `model://`, `file://` -> files.

The search order is: the packages that the caller provides, `robot.packages` of the scenario, the package of the
referring file, the workspace, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH (models: GAZEBO_MODEL_PATH, GZ_SIM_RESOURCE_PATH).
A name that no package.xml has is then the name of a folder: above the referring file, in the workspace, or on the path
for models. Collections of models have no package.xml, rename packages, and leave out folders.

A file must lie in the workspace, or in a package or model on one of those paths, because only the owner of the machine
can set them. Links are resolved first, so that a link cannot lead out of a package.

The file of a Gazebo model is found by address, by path, or in the folder of the model.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from itertools import islice, takewhile
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Final, NamedTuple
from urllib.parse import unquote

from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import FirstFew, nearest
from sim_action.core.workspace import OUTSIDE_REMEDY, Workspace, path_problem, similar_name
from sim_action.robot.documents.package_search import (
    MODEL_VARIABLES,
    PACKAGE_FILE,
    PACKAGE_VARIABLES,
    EnvironmentFolders,
    Listings,
    PackageFolders,
    PackageNames,
    by_distance,
    folders_below,
    folders_named,
    is_model,
    listed,
)
from sim_action.robot.documents.xml_document import ModelDocument, read_document

_MAX_LENGTH: Final = 4_000
_MAX_FOLDERS: Final = 100
_MAX_SHOWN: Final = 60


@dataclass(frozen=True, slots=True)
class Note:
    """A note for the user; two notes of the same rule about the same folder say the same."""

    rule: str
    text: str
    about: Path


class Reference(NamedTuple):
    """The parts of a reference."""

    scheme: str  # "package", "model", "file", or empty for a path
    name: str  # of the package or model; empty for other schemes, and for a file directly on the path for models
    path: str = ""  # below the package or model; absolute or relative for other schemes

    @classmethod
    def parsed(cls, text: str) -> Reference:
        """Return the parts of a text. One slash or three after the scheme are accepted. Raises ValueError."""
        if len(text) > _MAX_LENGTH or len(re.findall(r"[\\/]+", text)) > _MAX_FOLDERS:
            limits = f"{_MAX_LENGTH:,} characters and {_MAX_FOLDERS} folders"
            raise ValueError(f"{text[:_MAX_SHOWN]!r}... is too long for a reference; at most {limits} are allowed")
        match = re.fullmatch(r"(package|model|file):([\\/]+)(.*)", text.strip(), re.DOTALL)
        if match is None:
            if "://" in text:
                allowed = (
                    "package://name/path, model://name/path, file:///path, or a path relative to the referring file"
                )
                raise ValueError(f"'{text}' is not a valid reference; allowed are {allowed}")
            return cls("", "", text.strip())
        scheme, slashes, rest = match.groups()
        if scheme == "file":
            return cls(scheme, "", _path_of_address(rest if slashes == "//" else f"/{rest}"))
        name, _, path = rest.replace("\\", "/").partition("/")
        path = path.lstrip("/")
        if scheme == "model" and name and not path and PurePosixPath(name).suffix:
            # Gazebo looks for model://part.dae in each folder of the path for models.
            return cls(scheme, "", name)
        if not name or not path:
            raise ValueError(f"'{text}' names no file; write {scheme}://name/path/of/the/file")
        return cls(scheme, name, path)

    @property
    def is_absolute(self) -> bool:
        """Return True for the absolute path of an address such as file:///robot.stl."""
        has_drive = sys.platform == "win32" and PureWindowsPath(self.path).drive
        return self.scheme == "file" and bool(self.path.startswith("/") or has_drive)

    def odd_start(self, text: str) -> str:
        """Return the start of the text of this reference, with the name, if it is not as in package://name/."""
        text = text.strip()
        is_usual = not self.name or text.startswith(f"{self.scheme}://{self.name}/")
        return "" if is_usual else f"{text.partition(self.name)[0]}{self.name}"


def _path_of_address(rest: str) -> str:
    path = rest.removeprefix("localhost")
    # The path of file:///C:/robot.stl starts with a slash, too.
    is_on_drive = sys.platform == "win32" and PureWindowsPath(path[1:]).drive
    return path[1:] if is_on_drive else path


_MAX_SAME: Final = 100


class PackageError(Exception):
    """A reference to no usable file; `rule`: missing-package, missing-file, outside-workspace, bad-reference."""

    def __init__(self, rule: str, message: str) -> None:
        self.rule = rule
        super().__init__(message)


@dataclass(frozen=True, slots=True)
class ResolvedPath:
    """The file or folder that a reference names."""

    path: Path
    notes: tuple[Note, ...] = ()  # for the user, such as a second package
    is_guessed: bool = False  # True if no folder has the name of the package


@dataclass(frozen=True)
class Packages:
    """The packages that one scenario can use. The search of the workspace is cached: create one object per scenario."""

    workspace: Workspace  # the workspace of the scenario
    # `robot.packages`: name -> folder, relative to the scenario
    mapped: Mapping[str, str] = field(default_factory=dict)
    # environment variables; only those named above are read
    environment: Mapping[str, str] = field(default_factory=lambda: dict(os.environ), repr=False)
    _hinted: FirstFew = field(default_factory=FirstFew, init=False, repr=False, compare=False)
    _listings: Listings = field(default_factory=Listings, init=False, repr=False, compare=False)
    _names: PackageNames = field(default_factory=PackageNames, init=False, repr=False, compare=False)
    _cached: dict[tuple[str, str, Path], ResolvedPath | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _ordered: dict[tuple[str, Path], list[Path]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def mapped_problems(self) -> Iterator[tuple[str, str]]:
        """Yield each name in `robot.packages` that leads to no folder, and the problem."""
        for name in self.mapped:
            try:
                self._of_workspace(name) or self._mapped(name)
            except PackageError as error:
                yield name, str(error)

    def find(self, name: str, referrer: Path) -> ResolvedPath:
        """Return the folder of a package; `referrer` is the file that names it. Raises PackageError."""
        referring_file = referrer.resolve()
        package = self._declared("package", name, referring_file) or next(
            self._folders(Reference("package", name), referring_file), None
        )
        if package is None:
            raise self._missing("package", name, referring_file)
        return package

    def find_model(self, name: str, referrer: Path) -> ResolvedPath:
        """Return the folder of a Gazebo model, or of a package with that name. Raises PackageError."""
        referring_file = referrer.resolve()
        model = self._declared("model", name, referring_file)
        if model is None:
            raise self._missing("model", name, referring_file)
        return model

    def resolve(self, reference: str, referrer: Path) -> ResolvedPath:
        """Return the file that `reference`, written in `referrer`, names. Raises PackageError."""
        target = self.locate(reference, referrer)
        try:
            return replace(target, path=self.file(target.path, reference))
        except PackageError as error:
            stated = Reference.parsed(reference)
            if error.rule != "missing-file" or not stated.name:
                raise
            named = {*self._inside.packages.get(stated.name, ()), *self._inside.folders.get(stated.name, ())}
            places = sorted(named)[:_MAX_SAME]
            others = [self._shown(place) for place in places if self._is_there(place / stated.path)]
            advice = "which robot.packages, --package or the input packages can name"
            hint = f"; the file is in {listed(others)}, {advice}" if others else ""
            raise PackageError(error.rule, f"{error}{hint}") from None

    def locate(self, reference: str, referrer: Path) -> ResolvedPath:
        """Return the file or folder that `reference` names; it may be missing. Raises PackageError."""
        referring_file = referrer.resolve()
        first = None
        try:
            stated = Reference.parsed(reference)
        except ValueError as error:
            raise PackageError("bad-reference", str(error)) from None
        for candidate in self._candidates(stated, referring_file):
            first = first or (None if candidate.is_guessed else candidate)
            if self._is_there(candidate.path):
                start = stated.odd_start(reference)
                note = Note("file-spelling", f"'{start}' is read as '{stated.scheme}://{stated.name}/'", referring_file)
                return replace(candidate, notes=(*candidate.notes, note)) if start else candidate
        if first is not None:
            return first
        if stated.scheme == "file":
            meant = f"write file:///{stated.path}, or '{stated.path}' for a path relative to the referring file"
            raise PackageError("bad-reference", f"'{reference}': file:// needs an absolute path; {meant}")
        if not stated.name:
            searched = ", ".join(self._environment_folders.described(MODEL_VARIABLES))
            raise PackageError("missing-file", f"'{reference}' is in no folder for models (searched: {searched})")
        raise self._missing(stated.scheme, stated.name, referring_file)

    def _candidates(self, stated: Reference, referrer: Path) -> Iterator[ResolvedPath]:
        """Yield the paths that a reference may mean, the most likely one first; none if its package is unknown."""
        tried = list[ResolvedPath]()
        for folder in self._places(stated, referrer):
            tried.append(folder)
            yield replace(folder, path=folder.path / stated.path)
        for folder in tried:
            yield from self._respelled(folder, stated.path)
        is_chosen = self._of_workspace(stated.name) or stated.name in self.mapped
        if stated.name and not is_chosen and ".." not in PurePosixPath(stated.path).parts:
            yield from self._shortened(stated, referrer, self._declared(stated.scheme, stated.name, referrer))

    def _places(self, stated: Reference, referrer: Path) -> Iterator[ResolvedPath]:
        """Yield the folders in which the path of a reference may start."""
        if not stated.scheme or stated.is_absolute:
            yield ResolvedPath(Path() if stated.is_absolute else referrer.parent)
        elif stated.scheme == "file":
            # Gazebo searches such a path on the path for models.
            name, _, path = stated.path.partition("/") if "/" in stated.path else ("", "", stated.path)
            if self._is_there(referrer.parent / stated.path):
                yield ResolvedPath(
                    referrer.parent, (Note("file-spelling", f"'file://{name}' is read as a relative path", referrer),)
                )
            for folder in self._places(Reference("model", name, path), referrer):
                if self._is_there(folder.path / path):
                    yield replace(folder, path=folder.path.parent) if name else folder
        elif not stated.name:
            yield from map(ResolvedPath, self._environment_folders.model_path)
        elif (declared := self._declared(stated.scheme, stated.name, referrer)) is not None:
            yield declared
        else:
            yield from self._folders(stated, referrer)

    def _declared(self, scheme: str, name: str, referrer: Path) -> ResolvedPath | None:
        if (scheme, name, referrer) not in self._cached:
            self._cached[scheme, name, referrer] = (self._model if scheme == "model" else self._package)(name, referrer)
        return self._cached[scheme, name, referrer]

    def _folders(self, stated: Reference, referrer: Path) -> Iterator[ResolvedPath]:
        """Yield the folders with the name of a package that has no package.xml."""
        name = stated.name
        undeclared = f"no package.xml or model.config has the name '{name}'"
        for folder in self._above(referrer):
            if folder.name == name and not (folder / PACKAGE_FILE).is_file():
                yield self._noted(folder, f"{undeclared}: {self._shown(folder)}, above {referrer.name}, is used")
        if (name, referrer) not in self._ordered:
            # The model may be outside of the workspace, whose search misses the folders next to it.
            beside = folders_named(name, self._above(referrer))
            below = by_distance({*beside, *self._inside.folders.get(name, ())}, referrer)
            self._ordered[name, referrer] = below[:_MAX_SAME]
        below = self._ordered[name, referrer]
        suitable = [folder for folder in below if self._is_there(folder / stated.path)] or below[:1]
        for folder in suitable[:1]:
            others = listed(self._shown(other) for other in suitable[1:])
            reason = f"because it is nearest to {referrer.name}, not {others}" if others else "a folder of that name"
            yield self._noted(folder, f"{undeclared}: {self._shown(folder)} is used, {reason}")
        yield from map(ResolvedPath, self._environment_folders.named(name))

    def _respelled(self, folder: ResolvedPath, path: str) -> Iterator[ResolvedPath]:
        """Yield the file whose name differs in letter case or has slashes for backslashes."""
        place = self._listings.matched(folder.path, path, self.may_read)
        if place is not None:
            text = f"'{path}' is spelled {self._shown(place)} on the disk: write it like that, as Linux needs it"
            text += f"; not {listed(others)}" if (others := self._listings.similar(place)) else ""
            yield replace(folder, path=place, notes=(*folder.notes, Note("file-spelling", text, place.parent)))

    def _shortened(self, stated: Reference, referrer: Path, declared: ResolvedPath | None) -> Iterator[ResolvedPath]:
        """Yield files of a package whose outer folders were renamed or left out, below folders above the model."""
        parts = (stated.name, *PurePosixPath(stated.path).parts)
        above = list(self._above(referrer))
        for index in range(1, len(parts) - 1):
            start = "/".join(parts[: index + 1])
            for folder in above:
                if folder.name == parts[index]:
                    match = self._noted(folder, f"'{stated.scheme}://{start}' is read as {self._shown(folder)}")
                    yield replace(match, path=folder.joinpath(*parts[index + 1 :]), is_guessed=True)
        for folder in above if declared is None else ():
            text = f"no folder '{stated.name}' has the file: {self._shown(folder)}, above {referrer.name}, is used"
            yield replace(self._noted(folder, text), path=folder / stated.path, is_guessed=True)
        if declared is not None:
            yield from self._uninstalled(declared.path / stated.path)

    def _uninstalled(self, path: Path) -> Iterator[ResolvedPath]:
        """Yield the file that a package has in a deeper folder of its source, from where the build installs it."""
        package = next((folder for folder in self._above(path) if (folder / PACKAGE_FILE).is_file()), None)
        inner = () if package is None else path.relative_to(package).parts[:-1]
        if package is None or not inner or ".." in inner:
            return
        same = (place for place in self._inside.folders.get(inner[-1], ()) if place.is_relative_to(package))
        deeper = [place for place in same if place.relative_to(package).parts[-len(inner) :] == inner]
        deeper = [place for place in deeper if self._is_there(place / path.name)]
        for folder in by_distance(deeper, package / PACKAGE_FILE)[:1]:
            others = listed(self._shown(other) for other in deeper if other != folder)
            text = (
                f"{self._shown(package)} has no folder '{'/'.join(inner)}' with the file: {self._shown(folder)} is used"
            )
            yield replace(self._noted(folder, f"{text}, not {others}" if others else text), path=folder / path.name)

    def _noted(self, folder: Path, text: str) -> ResolvedPath:
        return ResolvedPath(folder, (Note("package-folder", f"{text}; set robot.packages to choose another", folder),))

    def _shown(self, path: Path) -> str:
        root = self.workspace.root
        return str(path.relative_to(root)) if path.is_relative_to(root) and path != root else str(path)

    def _is_there(self, path: Path) -> bool:
        """Return True if a path leads to a file or folder that may be read."""
        plain = str(path)
        try:  # most candidates are missing, and links take ten times as long to resolve
            is_likely = "%" in plain or ".." in plain or path.exists()
            return is_likely and self.place(path, plain).exists()
        except (PackageError, OSError, ValueError):
            return False

    def included(self, path: Path, reference: str) -> ResolvedPath:
        """Return the file at an absolute path, or where it is in its package's source. Raises PackageError."""
        try:
            return ResolvedPath(self.file(path, reference))
        except PackageError as error:
            source = next(self._uninstalled(path), None) if error.rule == "missing-file" else None
            if source is None:
                raise
            return replace(source, path=self.file(source.path, reference))

    def may_read(self, path: Path) -> bool:
        """Return True if a file or folder may be read; links in `path` must be resolved."""
        if path.is_relative_to(self.workspace.root):
            return self.workspace.refusal(path) is None
        return self.workspace.refusal(path) is None or self._environment_folders.contains(path)

    def file(self, path: Path, reference: str) -> Path:
        """Return the file at an absolute path; `reference` is its text in the referring file. Raises PackageError."""
        resolved = self.place(path, reference)
        is_file = resolved.is_file()
        is_folder = resolved.is_dir()
        is_there = resolved.exists()
        if is_there and not is_file and not is_folder:
            raise PackageError("missing-file", f"'{reference}' is not a regular file (looked for {resolved})")
        if not is_file:
            reason = "is a folder" if is_folder else "does not exist"
            # A model may miss many files.
            hint = similar_name(resolved) if self._hinted.one_more() else ""
            raise PackageError("missing-file", f"'{reference}' {reason} (looked for {resolved}){hint}")
        return resolved

    def place(self, path: Path, reference: str) -> Path:
        """Return a path that may be read, with its links resolved; it may be missing. Raises PackageError."""
        try:
            resolved = path.resolve()
            # %20 means a space, as in a URL, if no file has the literal name.
            if not resolved.exists() and "%" in reference:
                resolved = Path(unquote(str(path))).resolve()
                resolved.exists()
        except (OSError, ValueError, RuntimeError) as error:  # too long, contains a NUL, or a loop of links
            raise PackageError("bad-reference", f"{reference!r} is not a valid path: {path_problem(error)}") from None
        if not self.may_read(resolved):
            portable = "; better: a path relative to the referring file, or package://, works on every machine"
            is_absolute = reference.startswith(("/", "file:"))
            raise self._outside(f"'{reference}'", resolved, portable if is_absolute else "")
        return resolved

    def _package(self, name: str, referrer: Path) -> ResolvedPath | None:
        package = self._of_workspace(name) or self._mapped(name)
        package = package or self._own(name, referrer) or _nearest(self._inside.packages.get(name), referrer)
        return package or _of(self._environment_folders.package(name))

    def _model(self, name: str, referrer: Path) -> ResolvedPath | None:
        model = self._of_workspace(name) or self._mapped(name) or _nearest(self._inside.models.get(name), referrer)
        return model or _of(self._environment_folders.model(name)) or self._package(name, referrer)

    def _of_workspace(self, name: str) -> ResolvedPath | None:
        return _of(next((Path(folder) for package, folder in self.workspace.packages if package == name), None))

    def _mapped(self, name: str) -> ResolvedPath | None:
        if name not in self.mapped:
            return None
        what = f"'{name}: {self.mapped[name]}' in robot.packages"
        try:
            folder = (self.workspace.directory / self.mapped[name]).resolve()
            is_folder = folder.is_dir()
        except (OSError, ValueError, RuntimeError) as error:
            problem = path_problem(error, "folder")
            raise PackageError("missing-package", f"{what} is not a valid path: {problem}") from None
        if not self.may_read(folder):
            raise self._outside(what, folder)
        if not is_folder:
            raise PackageError("missing-package", f"{what} is not a folder (looked for {folder})")
        return ResolvedPath(folder)

    def _own(self, name: str, referrer: Path) -> ResolvedPath | None:
        """Return the package of the referring file, if it has this name: it comes before others of the same name."""
        for folder in self._above(referrer):
            manifest = folder / PACKAGE_FILE
            if manifest.is_file() and self.may_read(manifest.resolve()) and self._names.of(folder) == name:
                return ResolvedPath(folder)
        return None

    def _above(self, referrer: Path) -> Iterator[Path]:
        return takewhile(self.may_read, referrer.parents)

    @cached_property
    def _inside(self) -> PackageFolders:
        return folders_below(self.workspace.root, inside_packages=True)

    @cached_property
    def _environment_folders(self) -> EnvironmentFolders:
        return EnvironmentFolders(self.environment)

    def _outside(self, what: str, resolved: Path, advice: str = "") -> PackageError:
        where = f"{self.workspace.refusal(resolved)} (it is {resolved})"
        lifted = "name another file" if resolved.is_relative_to(self.workspace.root) else OUTSIDE_REMEDY
        return PackageError("outside-workspace", f"{what} {where}; {lifted}{advice}")

    def _missing(self, kind: str, name: str, referrer: Path) -> PackageError:
        inside, root = self._inside, self.workspace.root
        variables = (*MODEL_VARIABLES, *PACKAGE_VARIABLES) if kind == "model" else PACKAGE_VARIABLES
        hint = ""
        if self._hinted.one_more():
            packages, models = (
                (package for package, _ in self.workspace.packages),
                inside.models if kind == "model" else (),
            )
            names = {*self.mapped, *packages, *inside.packages, *self._environment_folders.package_names, *models}
            near = nearest(name, sorted(names))
            hint = "" if near is None else f"; did you mean '{near}'?"
        extent = (
            f"{len(inside.packages)} packages" if inside.complete else "only some of its folders: there are too many"
        )
        places = ("robot.packages", f"{root} ({extent})", *self._environment_folders.described(variables))
        where = referrer.relative_to(root) if referrer.is_relative_to(root) else referrer
        # For a key of a scenario, `referrer` is not a file, but a path in the scenario's folder.
        what = f"{where} refers to the {kind} '{name}', which" if referrer.is_file() else f"the {kind} '{name}'"
        # The workspace may start below the package.
        outside = next((folder for folder in referrer.parents if folder.name == name), "FOLDER")
        return PackageError(
            "missing-package",
            f"{what} was not found{hint} (searched: {', '.join(places)}); "
            f"add it to the repository, or set its folder: robot.packages: {{{name}: path/to/{name}}}, or "
            f"name a folder outside the repository: --package {name}={outside} (in the action: the input packages)",
        )


def _of(folder: Path | None) -> ResolvedPath | None:
    return None if folder is None else ResolvedPath(folder)


def _nearest(folders: tuple[Path, ...] | None, referrer: Path) -> ResolvedPath | None:
    """Return the folder with the shortest path from the referring file, with a warning if there are several."""
    if folders is None:
        return None
    nearest, *others = by_distance(folders, referrer)
    if not others:
        return ResolvedPath(nearest)
    chosen = f"{nearest} is used, because it is nearest to {referrer.name}, not {listed(map(str, others))}"
    text = f"{len(folders)} packages have the same name: {chosen}; set robot.packages to choose one"
    return ResolvedPath(nearest, (Note("several-packages", text, nearest),))


Version = tuple[int, int]
NEWEST: Final[Version] = (1, 12)  # the newest version of SDF that is supported; a newer file is read as this version
_MAX_FILES_READ: Final = 10_000
_MAX_FILES_NAMED: Final = 10
_MANIFEST: Final = "model.config"
_MODEL: Final = "model.sdf"


def find_model_file(
    reference: str, referrer: Path, packages: Packages, read: Callable[[Path], ModelDocument] = read_document
) -> ResolvedPath:
    """Return the file that an address, path or model folder names; `read`: for model.config. Raises PackageError."""
    scheme, separator, rest = reference.partition("://")
    notes: tuple[Note, ...] = ()
    name, _, path = rest.partition("/")
    if not separator:
        place = referrer.resolve().parent / reference
        if "/" not in reference and not place.suffix and not is_folder(place):
            # A bare name is a model's name, as in SDF_PATH.
            return find_model_file(f"model://{reference}", referrer, packages, read)
    elif name and scheme in {"model", "package"}:
        find = packages.find_model if scheme == "model" else packages.find
        target = packages.locate(reference, referrer) if path else find(name, referrer)
        place, notes = target.path, target.notes
    else:
        return packages.resolve(reference, referrer)
    if not is_folder(place):
        return ResolvedPath(packages.file(place, reference), notes)
    return ResolvedPath(_file_in(place.resolve(), reference, packages, read), notes)


def is_model_folder(path: Path) -> bool:
    """Return True if a folder contains a model.config or a model.sdf."""
    return is_folder(path) and is_model(path)


def is_folder(path: Path) -> bool:
    """Return True if a path is a folder, for any text as path."""
    try:
        return path.is_dir()
    except (OSError, ValueError, RuntimeError):
        return False


def model_files_in(folder: Path) -> tuple[str, ...]:
    """Return the likeliest model files in a folder, or else below it; those with the suffix .xml come last."""
    for suffixes in ((".urdf", ".xacro", ".sdf"), (".xml",)):
        for pattern in ("*", "*/*", "*/*/*"):
            files = [path for path in islice(folder.glob(pattern), _MAX_FILES_READ) if path.suffix in suffixes]
            likely = sorted(files, key=lambda path: (path.stem not in folder.name, str(path)))
            if named := [path.relative_to(folder).as_posix() for path in likely if path.name != PACKAGE_FILE]:
                return tuple(named[:_MAX_FILES_NAMED])
    return ()


def parsed_version(text: str) -> Version:
    """Return the version of SDF in a text such as "1.9"; (0, 0) if it is not a version."""
    match = re.fullmatch(r"\s*([0-9]{1,4})\.([0-9]{1,4})\s*", text)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def _file_in(folder: Path, reference: str, packages: Packages, read: Callable[[Path], ModelDocument]) -> Path:
    """Return the newest supported file that model.config names, or model.sdf."""
    try:
        manifest = packages.file(folder / _MANIFEST, reference)
    except PackageError:
        return packages.file(folder / _MODEL, f"{reference}/{_MODEL}")
    files = read(manifest).root.findall("sdf")
    if not files:
        raise PackageError("missing-file", f"{manifest} has no <sdf> element, which names the model's file")
    supported_files = [file for file in files if parsed_version(file.get("version", "")) <= NEWEST]
    best = max(supported_files or files, key=lambda file: parsed_version(file.get("version", "")))
    name = (best.text or "").strip()
    return packages.file(folder / name, f"{reference}/{name}")
