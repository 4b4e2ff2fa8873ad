"""Find the file of a Gazebo model: by address, by path, or in the folder of a model."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Final

from sim_action.robot.documents.package_search import PACKAGE_FILE, is_model
from sim_action.robot.documents.packages import Found, Note, PackageError, Packages
from sim_action.robot.documents.xml_document import ModelDocument, read_document

Version = tuple[int, int]

NEWEST: Final[Version] = (1, 11)
"""The newest version of SDF that is supported; a newer file is read as this version."""

_MAX_FILES_READ: Final = 10_000
_MAX_FILES_NAMED: Final = 10

_MANIFEST: Final = "model.config"

_MODEL: Final = "model.sdf"


def find_model_file(
    reference: str, referrer: Path, packages: Packages, read: Callable[[Path], ModelDocument] = read_document
) -> Found:
    """Return the file of a model that an address, a path, or a folder of a Gazebo model names. Raises PackageError.

    :param read: reads a model.config.
    """
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
        found = packages.locate(reference, referrer) if path else find(name, referrer)
        place, notes = found.path, found.notes
    else:
        return packages.resolve(reference, referrer)
    if not is_folder(place):
        return Found(packages.file(place, reference), notes)
    return Found(_file_in(place.resolve(), reference, packages, read), notes)


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
    """Return the first files in a folder that may be models, the likeliest one first.

    The folders below it are read if it has none. Files with the suffix .xml count if there are no others.
    """
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
    known = [file for file in files if parsed_version(file.get("version", "")) <= NEWEST]
    best = max(known or files, key=lambda file: parsed_version(file.get("version", "")))
    name = (best.text or "").strip()
    return packages.file(folder / name, f"{reference}/{name}")
