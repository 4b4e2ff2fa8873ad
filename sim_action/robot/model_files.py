"""Which file a model's name leads to: an address, a path, or the folder of a Gazebo model."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

from sim_action.robot.document import ModelDocument, read_document
from sim_action.robot.package_folders import is_model
from sim_action.robot.packages import Found, PackageError, Packages

Version = tuple[int, int]

NEWEST: Final[Version] = (1, 11)
"""Of SDF, as it is read here; a newer file is read as this one."""

_MANIFEST: Final = "model.config"
_MODEL: Final = "model.sdf"


def find_model_file(
    reference: str, referrer: Path, packages: Packages, read: Callable[[Path], ModelDocument] = read_document
) -> Found:
    """The file of a model that an address, a path, or its folder names; `read`: a model.config. Raises PackageError."""
    scheme, separator, rest = reference.partition("://")
    warning = None
    name, _, path = rest.partition("/")
    if not separator:
        place = referrer.resolve().parent / reference
        if "/" not in reference and not place.suffix and not _is_folder(place):
            # As SDF_PATH has it: a model's bare name.
            return find_model_file(f"model://{reference}", referrer, packages, read)
    elif name and scheme in {"model", "package"}:
        found = (packages.find_model if scheme == "model" else packages.find)(name, referrer)
        place, warning = found.path / path, found.warning
    else:
        return packages.resolve(reference, referrer)
    if not _is_folder(place):
        return Found(packages.file(place, reference), warning)
    return Found(_file_in(place.resolve(), reference, packages, read), warning)


def is_model_folder(path: Path) -> bool:
    """Whether a folder has a model.config or a model.sdf in it."""
    return _is_folder(path) and is_model(path)


def parsed_version(text: str) -> Version:
    """Of SDF, such as "1.9"; (0, 0) for what is none."""
    match = re.fullmatch(r"\s*([0-9]{1,4})\.([0-9]{1,4})\s*", text)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def _file_in(folder: Path, reference: str, packages: Packages, read: Callable[[Path], ModelDocument]) -> Path:
    """What model.config names as the newest that is read here, or model.sdf."""
    try:
        manifest = packages.file(folder / _MANIFEST, reference)
    except PackageError:
        return packages.file(folder / _MODEL, f"{reference}/{_MODEL}")
    files = read(manifest).root.findall("sdf")
    if not files:
        raise PackageError("missing-file", f"{manifest} names no <sdf> file")
    known = [file for file in files if parsed_version(file.get("version", "")) <= NEWEST]
    best = max(known or files, key=lambda file: parsed_version(file.get("version", "")))
    name = (best.text or "").strip()
    return packages.file(folder / name, f"{reference}/{name}")


def _is_folder(path: Path) -> bool:
    """No name is too odd to ask."""
    try:
        return path.is_dir()
    except (OSError, ValueError, RuntimeError):
        return False
