"""The provenance of a run: the processor, the build of the engine, and the versions of Python and packages.

The same seed gives the same digest on one machine. If two digests differ, compare their provenance.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import escaped_line

_CPU_INFO: Final = Path("/proc/cpuinfo")
_SYSCTL: Final = ("/usr/sbin/sysctl", "-n", "machdep.cpu.brand_string")
_METADATA: Final = ".dist-info"
_LIBRARIES: Final = (".so", ".pyd", ".dylib", ".dll")
_MAX_CHARS: Final = 200
_DIGEST_DIGITS: Final = 12


class Provenance(FrozenModel):
    """The machine and the software that made a run.

    Attributes:
        cpu: the model of the processor.
        host: the name of the machine; None in older results.
        packages: names and versions of other packages that computed commands.
        engine_build: the version of the engine's package, the platform of its wheel, and a digest of its libraries.
    """

    cpu: str
    engine_build: str | None = None
    sim_action: str
    python: str
    numpy: str | None = None
    platform: str
    host: str | None = None
    packages: tuple[str, ...] = ()


@cache
def provenance(package: str, sim_action: str) -> Provenance:
    """Return the provenance of runs on this machine; `package`: the engine's name in pip; `sim_action`: our version."""
    return Provenance(
        cpu=_short(cpu_model()),
        engine_build=_build(package),
        sim_action=sim_action,
        python=platform.python_version(),
        numpy=installed_version("numpy"),
        platform=_short(platform_name()),
        host=_short(platform.node()) or None,
    )


def cpu_model() -> str:
    """Return the name of the processor, or at worst its architecture."""
    # Elsewhere, `platform.processor` starts the program `uname` that is first on PATH.
    processor = platform.processor() if sys.platform == "win32" else ""
    return _named_by_system() or processor or platform.machine() or "unknown"


def platform_name() -> str:
    """Return the name and version of the system, such as Linux-6.8.0-x86_64-with-glibc2.39; start no program."""
    if sys.platform == "win32":
        return platform.platform()
    if sys.platform == "darwin":
        return f"macOS-{platform.mac_ver()[0]}-{platform.machine()}"
    library = "".join(platform.libc_ver())
    system = os.uname()
    parts = (system.sysname, system.release, system.machine, f"with-{library}" if library else "")
    return "-".join(filter(None, parts))


def _named_by_system() -> str:
    """Return the name that the system gives the processor; "" if there is none."""
    with suppress(OSError, subprocess.SubprocessError):
        if sys.platform == "linux":
            return named_in_cpu_info(_CPU_INFO.read_text(encoding="utf-8", errors="replace"))
        if sys.platform == "darwin":
            asked = subprocess.run(_SYSCTL, capture_output=True, text=True, timeout=5, check=True)  # noqa: S603 - fixed
            return asked.stdout.strip()
    return ""


def named_in_cpu_info(text: str) -> str:
    """Return the first processor in /proc/cpuinfo; for ARM, which has no names, its numbers; "" if there is none."""
    lines = (line.partition(":") for line in text.split("\n\n", maxsplit=1)[0].splitlines())
    fields = {key.strip(): value.strip() for key, _, value in lines}
    if name := fields.get("model name") or fields.get("Processor"):
        return name
    parts = [f"{key.removeprefix('CPU ')} {fields[key]}" for key in ("CPU implementer", "CPU part") if key in fields]
    return f"{platform.machine()}, {', '.join(parts)}" if parts else ""


def installed_version(package: str) -> str | None:
    """Return the version of an installed package; None if it is not installed."""
    folder = _metadata_folder(package)
    return folder.name.removesuffix(_METADATA).rpartition("-")[2] if folder is not None else _stated_version(package)


def _stated_version(package: str) -> str | None:
    """Return the version of a package that pip has not unpacked into a folder."""
    # Its import takes longer than reading a scenario.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


@cache
def _metadata_folder(package: str) -> Path | None:
    """Return the folder in which pip describes an installed package, such as mujoco_core-4.0.1.dist-info."""
    start = f"{package.replace('-', '_')}-".lower()
    for folder in sys.path:
        with suppress(OSError):
            for name in os.listdir(folder or os.curdir):  # noqa: PTH208 - several times quicker than pathlib
                if name.lower().startswith(start) and name.endswith(_METADATA):
                    return Path(folder, name)
    return None


def _build(package: str) -> str | None:
    installed = installed_version(package)
    if installed is None:
        return None
    folder = _metadata_folder(package)
    return _short(", ".join((f"{package} {installed}", *(_of_wheel(folder) if folder else ()))))


def _of_wheel(folder: Path) -> Iterator[str]:
    """Yield the platform tag of a package's wheel and a digest of its libraries, as far as pip recorded them."""
    for line in _lines(folder / "WHEEL"):
        if line.startswith("Tag: "):
            yield line.removeprefix("Tag: ")
            break
    libraries = sorted(line for line in _lines(folder / "RECORD") if _is_library(line.partition(",")[0]))
    if libraries:
        digest = hashlib.sha256("\n".join(libraries).encode()).hexdigest()
        yield f"libraries {digest[:_DIGEST_DIGITS]}"


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []


def _is_library(path: str) -> bool:
    name = path.rpartition("/")[2]
    return name.endswith(_LIBRARIES) or ".so." in name


def _short(text: str) -> str:
    return escaped_line(text)[:_MAX_CHARS]
