"""Wheels: downloaded by pip, checked against the hashes of a lock file, and unpacked by the standard library.

pip needs three times as long to install the same wheels: it compiles, compares and moves files one by one.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Final

from action.lock import Entry, text_of, wheels_of

# Settings of pip in a job choose the package index. They must not choose the target of the installation.
_PIP_VARIABLES: Final = ("PIP_PYTHON", "PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER", "PIP_DRY_RUN")
_PIP_OPTIONS: Final = (
    *("--quiet", "--disable-pip-version-check", "--no-input"),
    *("--require-hashes", "--only-binary", ":all:", "--no-deps"),
)
_UNUSED: Final = {
    "pybullet": ("pybullet_data", "pybullet_envs", "pybullet_examples", "pybullet_robots", "eglRenderer."),
}
"""Package -> how the paths of its unused files start: models, training environments and a renderer, 150 MB."""

_THREADS: Final = 2  # one for the largest wheel, one for all others
_CHUNK_BYTES: Final = 1 << 20


class InstallError(Exception):
    """Packages that could not be installed; pip has printed the reason."""


class WheelError(Exception):
    """A folder without the wheels of the lock file, or a wheel that cannot be unpacked."""


def download(packages: Sequence[Entry], folder: Path) -> None:
    """Download the wheels of packages into a folder, with the settings of pip that the job has. Raises InstallError."""
    with tempfile.TemporaryDirectory() as temporary:
        lock = Path(temporary, "requirements.lock")
        lock.write_text(text_of(packages), encoding="utf-8", newline="\n")
        # pip starts a second interpreter, which -I does not reach.
        foreign = {"PYTHONPATH", "PYTHONHOME", *_PIP_VARIABLES}
        variables = {name: value for name, value in os.environ.items() if name not in foreign}
        variables["PIP_REQUIRE_VIRTUALENV"] = "0"
        command = (
            sys.executable,
            "-I",
            "-m",
            "pip",
            "download",
            "--dest",
            folder,
            *_PIP_OPTIONS,
            "--requirement",
            lock,
        )
        if subprocess.run(command, env=variables, check=False).returncode:
            raise InstallError


def are_there(packages: Iterable[Entry], folder: Path) -> bool:
    """Return True if a folder has a wheel of each package; the content of the wheels is not checked."""
    found = wheels_of(folder)
    return all((entry.name, entry.version) in found for entry in packages)


@dataclass(frozen=True)
class Target:
    """The place of an installation.

    Attributes:
        python: the interpreter for scripts.
        folders: kind of files, as in the folder `.data` of a wheel -> their folder; other kinds are left out.
    """

    python: Path
    folders: Mapping[str, Path]


def install(packages: Iterable[Entry], wheels: Path, target: Target) -> int:
    """Check and unpack the wheels of packages, and return their size in bytes. Raises WheelError, OSError."""
    found = wheels_of(wheels)
    pairs: list[tuple[Entry, Path]] = []
    for entry in packages:
        match found.get((entry.name, entry.version), []):
            case [wheel]:
                pairs.append((entry, wheel))
            case several:
                raise WheelError(f"{len(several)} wheels of {entry.name} {entry.version} instead of one")
    pairs.sort(key=lambda pair: pair[1].stat().st_size, reverse=True)
    with ThreadPoolExecutor(_THREADS) as pool:
        return sum(pool.map(partial(_install_one, target), pairs))


def _install_one(target: Target, pair: tuple[Entry, Path]) -> int:
    entry, wheel = pair
    # The bytes that were checked are unpacked: another process can replace the file at any time.
    content = wheel.read_bytes()
    if hashlib.sha256(content).hexdigest() not in entry.hashes:
        raise WheelError(f"{wheel.name} does not have a hash of the lock file")
    unpack(content, target, _UNUSED.get(entry.name, ()))
    return len(content)


def unpack(content: bytes, target: Target, unused: tuple[str, ...] = ()) -> None:
    """Unpack a wheel. Raises WheelError for a damaged wheel, and for a path that leads out of its folder; OSError.

    `unused`: the beginnings of paths that are left out.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for member in archive.infolist():
                if not member.is_dir() and not member.filename.startswith(unused):
                    _write(archive, member, target)
    except (zipfile.BadZipFile, zlib.error, RuntimeError, LookupError, ValueError, EOFError) as error:
        raise WheelError(str(error)) from None


def _write(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Target) -> None:
    kind, path = _place(member.filename)
    if kind not in target.folders:
        return
    place = target.folders[kind] / path
    place.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(member) as source, place.open("wb") as file:
        if kind == "scripts":
            # Wheels name the interpreter so that an installer can put in its own.
            first = source.readline()
            python = f"#!{target.python}".encode()
            file.write(re.sub(rb"\A#!python(w?)(?=\s)", lambda _: python, first))
        shutil.copyfileobj(source, file, _CHUNK_BYTES)
    if kind == "scripts" or (member.external_attr >> 16) & stat.S_IXUSR:
        place.chmod(0o755)


def _place(name: str) -> tuple[str, PurePosixPath]:
    """Return the kind of a file of a wheel, and its path in the folder of that kind. Raises WheelError."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or not path.parts or re.search(r"[\\:\0]", name):
        raise WheelError(f"a wheel has a file with the path {name!r}")
    if not path.parts[0].endswith(".data"):
        return "purelib", path
    if len(path.parts) < 3:
        raise WheelError(f"a wheel has a file with the path {name!r}")
    return path.parts[1], PurePosixPath(*path.parts[2:])
