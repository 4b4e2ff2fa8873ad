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
import struct
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
from typing import IO, Final

from action.lock import Entry, text_of, wheels_of

# Settings of pip in a job choose the package index. They must not choose the target of the installation.
_PIP_VARIABLES: Final = ("PIP_PYTHON", "PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER", "PIP_DRY_RUN")
_PIP_OPTIONS: Final = (
    *("--quiet", "--disable-pip-version-check", "--no-input"),
    *("--require-hashes", "--only-binary", ":all:", "--no-deps"),
)
_UNUSED: Final = {
    "pybullet": ("pybullet_data", "pybullet_envs", "pybullet_examples", "pybullet_robots", "eglRenderer.")
}
"""Package -> how the paths of its unused files start: models, training environments and a renderer, 149 MB."""

_WITH_DEBUG_INFO: Final = frozenset({"pybullet"})
"""Packages whose libraries are installed without the parts for debuggers: 131 of the 140 MB of PyBullet's."""

_ELF64: Final = b"\x7fELF\x02\x01"
"""The first bytes of a library of 64-bit Linux whose numbers begin with their lowest byte."""

_HEADERS_BYTES: Final = 1 << 16
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
    present = wheels_of(folder)
    return all((entry.name, entry.version) in present for entry in packages)


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
    present = wheels_of(wheels)
    pairs: list[tuple[Entry, Path]] = []
    for entry in packages:
        match present.get((entry.name, entry.version), []):
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
    unpack(content, target, _UNUSED.get(entry.name, ()), debug_info=entry.name not in _WITH_DEBUG_INFO)
    return len(content)


def unpack(content: bytes, target: Target, unused: tuple[str, ...] = (), *, debug_info: bool = True) -> None:
    """Unpack a wheel. Raises WheelError for a damaged wheel, and for a path that leads out of its folder; OSError.

    `unused`: the beginnings of paths that are left out. `debug_info`: False leaves out the parts of Linux libraries
    that are not loaded when a library is.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for member in archive.infolist():
                if not member.is_dir() and not member.filename.startswith(unused):
                    _write(archive, member, target, debug_info=debug_info or ".so" not in member.filename)
    except (zipfile.BadZipFile, zlib.error, RuntimeError, LookupError, ValueError, EOFError) as error:
        raise WheelError(str(error)) from None


def _write(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Target, *, debug_info: bool) -> None:
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
        if debug_info:
            shutil.copyfileobj(source, file, _CHUNK_BYTES)
        else:
            _copy_loaded(source, file)
    if kind == "scripts" or (member.external_attr >> 16) & stat.S_IXUSR:
        place.chmod(0o755)


def _copy_loaded(source: IO[bytes], file: IO[bytes]) -> None:
    """Copy a library without what follows its last segment: names and lines for debuggers, and the table of sections.

    Linux loads a library by its segments alone. Any other file is copied whole.
    """
    head = bytearray(source.read(_HEADERS_BYTES))
    left = _loaded_bytes(head)
    if left is None:
        file.write(head)
        shutil.copyfileobj(source, file, _CHUNK_BYTES)
        return
    # There is no table of sections: its place, and the number of its entries and the entry of their names.
    struct.pack_into("<Q", head, 40, 0)
    struct.pack_into("<HH", head, 60, 0, 0)
    while head and left > 0:
        file.write(head[:left])
        left -= len(head)
        head = bytearray(source.read(_CHUNK_BYTES))


def _loaded_bytes(head: bytearray) -> int | None:
    """Return where the last segment of a library ends; None: the file is no library whose segments are known."""
    if len(head) < 64 or not head.startswith(_ELF64):
        return None
    (begin,) = struct.unpack_from("<Q", head, 32)
    size, count = struct.unpack_from("<HH", head, 54)
    if not count or size < 56 or begin + size * count > len(head):
        return None
    headers = (struct.unpack_from("<QQQQ", head, begin + size * number + 8) for number in range(count))
    ends: list[int] = [begin + size * count, *(offset + length for offset, _, _, length in headers)]
    return max(ends)


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
