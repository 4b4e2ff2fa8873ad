"""The installation of ROS 2: a sourced or RoboStack environment, /opt/ros, or the wheels of PyPI.

Files alone are looked at; no process is started. The release is the one of rclpy, which each distribution raises.

The environment of an install prefix is set by its setup.bash, and read from .dsv files without a shell. Such a file has
a change per line, such as `prepend-non-duplicate;PYTHONPATH;lib/python3.12/site-packages` (colcon and ament write it
next to each script). A script without such a file cannot be read, and is named instead.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.files import content_or_empty
from sim_action.core.process import program_on_path
from sim_action.core.records import dataclass

_SHELLS: Final = frozenset({".sh", ".bash"})
_INDEX: Final = Path("share/ament_index/resource_index")
# Folders with a file for each package; the file has its dependencies, separated by `:` or `;`.
_INDEXES: Final = (_INDEX / "packages", _INDEX / "package_run_dependencies", Path("share/colcon-core/packages"))
_MAX_FILE_BYTES: Final = 100_000
_MAX_DEPTH: Final = 5

PYTHON_VARIABLE: Final = "SIM_ACTION_ROS2_PYTHON"
"""The environment variable that names the Python of ROS 2, such as one with the wheels."""

DISTRIBUTIONS: Final = ("jazzy", "kilted", "lyrical", "humble")
"""The distributions that sim-action supports. The first of them counts if several are in /opt/ros."""

RMW: Final = "rmw_fastrtps_cpp"  # the middleware: Fast DDS, whose processes become observably quiet between two ticks

WHEELS: Final = {
    "jazzy": (
        *("ros-jazzy-rclpy", "ros-jazzy-rmw-fastrtps-cpp", "ros-jazzy-rmw-implementation", "ros-jazzy-geometry-msgs"),
        *("ros-jazzy-sensor-msgs", "ros-jazzy-nav-msgs", "ros-jazzy-trajectory-msgs", "ros-jazzy-rosgraph-msgs"),
        "ros-jazzy-std-srvs",
    ),
    "kilted": (
        *("ros-rclpy[fastrtps]", "ros-geometry-msgs", "ros-sensor-msgs", "ros-nav-msgs", "ros-trajectory-msgs"),
        *("ros-rosgraph-msgs", "ros-std-srvs"),
    ),
}
"""The packages of PyPI with all that the bridge needs, by distribution."""

INSTALLING: Final = (
    "source the setup.bash of a ROS 2 that is installed, or install the wheels (Linux x86-64, Python 3.10 to 3.13): "
    f"python3 -m venv ~/ros2 && ~/ros2/bin/pip install {' '.join(WHEELS[DISTRIBUTIONS[0]])} && "
    f"export {PYTHON_VARIABLE}=~/ros2/bin/python"
)

_ROOT: Final = Path("/opt/ros")
_PACKAGE_ROOT: Final = str(Path(__file__).resolve().parents[3])
_RELEASES: Final = {"1": "foxy", "3": "humble", "4": "iron", "7": "jazzy", "9": "kilted"}
"""Major version of rclpy -> distribution. Foxy and Galactic share one; a newer one is known by its folder."""

# Topics of other packages of messages are left out where these are not installed.
_MESSAGES: Final = ("geometry_msgs", "rosgraph_msgs", "std_msgs")
_VERSION: Final = re.compile(rb"<version>\s*(\d+)\.([\d.]+)\s*</version>")
# The bootstrap of the wheels starts each interpreter a second time, to extend LD_LIBRARY_PATH; this variable ends it.
_IS_BOOTSTRAPPED: Final = {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}


def packages_of_prefix(prefix: Path) -> list[str]:
    """Return the names of the packages that are installed in a prefix, each after its dependencies."""
    dependencies: dict[str, set[str]] = {}
    for index in _INDEXES:
        for file in _files(prefix / index):
            text = content_or_empty(file, _MAX_FILE_BYTES).decode(errors="replace")
            dependencies.setdefault(file.name, set()).update(text.replace(os.pathsep, ";").split(";"))
    graph = {name: sorted(dependencies[name] & dependencies.keys() - {name}) for name in sorted(dependencies)}
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError:
        return list(graph)


def set_up(prefixes: Iterable[Path], environment: Mapping[str, str]) -> SetUp:
    """Return the environment after the setup.bash of each prefix, the last one of the list first."""
    changes = SetUp(environment)
    for prefix in reversed(list(prefixes)):
        for package in packages_of_prefix(prefix):
            changes.read_first(prefix, (f"share/{package}/package.dsv", f"share/{package}/local_setup.dsv"))
        # The hook of some builds is missing; all tools of ROS 2 need this variable.
        changes.add("AMENT_PREFIX_PATH", str(prefix))
    return changes


class SetUp:
    """The variables that sourced prefixes set or extend; `unread`: scripts that would have to be run by a shell."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self.variables: dict[str, str] = {}
        self.unread: list[str] = []

    def read_first(self, prefix: Path, names: Iterable[str]) -> None:
        """Read the first of the files that exists."""
        file = next((path for name in names if (path := prefix / name).is_file()), None)
        if file is not None:
            self._read(prefix, file, _MAX_DEPTH)

    def add(self, name: str, path: str, *, first: bool = True) -> None:
        """Put a path first or last in a variable, unless it is there."""
        before = [entry for entry in self._value(name).split(os.pathsep) if entry]
        after = [path, *before] if first else [*before, path]
        self.variables[name] = os.pathsep.join(before if path in before else after)

    def _value(self, name: str) -> str:
        return self.variables.get(name, self._environment.get(name, ""))

    def _read(self, prefix: Path, file: Path, depth: int) -> None:
        scripts: dict[Path, set[str]] = {}
        for line in content_or_empty(file, _MAX_FILE_BYTES).decode(errors="replace").splitlines():
            kind, semicolon, rest = line.partition(";")
            if not semicolon or line.startswith("#"):
                continue
            if kind == "source":
                path = prefix / rest
                scripts.setdefault(path.with_suffix(""), set()).add(path.suffix)
            else:
                self._change(prefix, kind, rest.split(";"))
        for script, suffixes in scripts.items():
            hook = script.with_name(f"{script.name}.dsv")
            if hook.is_file() and depth:
                self._read(prefix, hook, depth - 1)
            elif shells := sorted(suffixes & _SHELLS, reverse=True):
                self.unread.append(f"{script}{shells[0]}")

    def _change(self, prefix: Path, kind: str, words: list[str]) -> None:
        name, *values = words
        if kind in ("prepend-non-duplicate", "prepend-non-duplicate-if-exists", "append-non-duplicate"):
            for path in (prefix / value for value in values):
                if not kind.endswith("exists") or path.exists():
                    self.add(name, str(path), first=kind.startswith("prepend"))
        elif kind == "set" or (kind == "set-if-unset" and not self._value(name)):
            value = ";".join(values)
            self.variables[name] = str(prefix / value) if (prefix / value).exists() else value


def _files(folder: Path) -> Iterator[Path]:
    try:
        return (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))
    except OSError:
        return iter(())


class NotInstalled(UsageError):
    """There is no ROS 2 at any place."""


@dataclass(frozen=True, slots=True)
class Ros2:
    """An installation of ROS 2: the prefixes, the user's first, and the interpreter that has rclpy.

    `rmw`: as in RMW_IMPLEMENTATION. `source`: where it was found, in words. `variables`: of all processes. `unread`:
    scripts of its setup.bash that only a shell can run, and that were not run.
    """

    prefixes: tuple[Path, ...]
    python: Path
    distribution: str
    rmw: str
    source: str
    variables: Mapping[str, str]
    unread: tuple[str, ...] = ()

    @property
    def prefix(self) -> Path:
        """The prefix that has rclpy."""
        return next(filter(_has_rclpy, self.prefixes))

    @property
    def notes(self) -> list[str]:
        """Notes for the user: what this setup of ROS 2 lacks."""
        if not self.unread:
            return []
        scripts = ", ".join(self.unread)
        return [f"not run, because only a shell can: {scripts}; if nodes need what they set, source setup.bash before"]

    def __str__(self) -> str:
        """Return one line for messages."""
        return f"{self.distribution} in {self.prefix} (from {self.source}), Fast DDS ({self.rmw}), for {self.python}"


@dataclass(frozen=True, slots=True)
class _Place:
    """A place to look at: its prefixes, where it was found, and its Python if it is known."""

    prefixes: tuple[Path, ...]
    source: str
    python: Path | None = None


def find_ros(environment: Mapping[str, str] | None = None, root: Path = _ROOT) -> Ros2:
    """Return the ROS 2 to run nodes with. Raise NotInstalled, or UsageError if it cannot be used."""
    variables = os.environ if environment is None else environment
    stated = variables.get("RMW_IMPLEMENTATION") or RMW
    if stated != RMW:
        raise UsageError(
            f"RMW_IMPLEMENTATION is {stated}, and lock-step needs Fast DDS; set RMW_IMPLEMENTATION={RMW}, or unset it"
        )
    try:
        place = next(_places(variables, root), None)
        if place is not None:
            return _checked(place, variables)
    except OSError as error:  # a name that is too long, or a folder that cannot be read
        raise UsageError(f"ROS 2 cannot be read: {error}") from None
    raise NotInstalled(f"ROS 2 is not installed; {INSTALLING}")


def _places(variables: Mapping[str, str], root: Path) -> Iterator[_Place]:
    """Yield the places with rclpy, best first. Raise UsageError if the named Python has none."""
    stated = variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes = tuple(dict.fromkeys(path for path in map(Path, filter(None, stated)) if path.is_absolute()))
    sourced = _Place(prefixes, "the sourced environment")
    # Without rclpy, these are workspaces on top of one of the other places.
    users = () if any(map(_has_rclpy, prefixes)) else prefixes
    if named := variables.get(PYTHON_VARIABLE):
        yield _of_named(Path(named).expanduser(), sourced, users)
    installed = [root / name for name in DISTRIBUTIONS] + sorted(root.glob("*"), reverse=True)
    others = [_Place((*users, Path(sys.prefix)), "the environment of this Python")]
    others += [_Place((*users, path), str(root)) for path in installed]
    yield from (place for place in (sourced, *others) if any(map(_has_rclpy, place.prefixes)))


def _of_named(python: Path, sourced: _Place, users: tuple[Path, ...]) -> _Place:
    """Return the place of the Python that the variable names. Raise UsageError."""
    if not (python.is_file() and os.access(python, os.X_OK)):
        raise UsageError(f"{PYTHON_VARIABLE} is {python}, which is not a program; set it to the Python of ROS 2")
    prefix = Path(os.path.abspath(python)).parent.parent  # noqa: PTH100 - links of virtual environments are kept
    if _has_rclpy(prefix):
        return _Place((*users, prefix), PYTHON_VARIABLE, python.absolute())
    if any(map(_has_rclpy, sourced.prefixes)):
        return _Place(sourced.prefixes, f"{sourced.source} and {PYTHON_VARIABLE}", python.absolute())
    # Wheels do not belong into the Python of the system.
    is_own = (prefix / "pyvenv.cfg").is_file()
    fix = f"run {python} -m pip install {' '.join(WHEELS[DISTRIBUTIONS[0]])}" if is_own else INSTALLING
    raise UsageError(f"{PYTHON_VARIABLE} is {python}, and {prefix} has no rclpy; {fix}; or unset {PYTHON_VARIABLE}")


def _checked(place: _Place, variables: Mapping[str, str]) -> Ros2:
    """Return the installation of a place. Raise UsageError if it cannot be used."""
    prefix = next(filter(_has_rclpy, place.prefixes))
    location = f"{prefix} (from {place.source})"
    distribution, version = _distribution(prefix)
    if distribution not in DISTRIBUTIONS:
        name = distribution or "of an unknown distribution"
        raise UsageError(
            f"the ROS 2 in {location} is {name} (rclpy {version}), and sim-action supports {', '.join(DISTRIBUTIONS)}; "
            f"use one of them: {INSTALLING}"
        )
    python = place.python or _python(prefix, location)
    _check_parts(place, location, distribution)
    base = _wheel_variables(prefix, variables) if _is_of_wheels(prefix) else _inherited(variables)
    hooked = [path for path in place.prefixes if path != prefix] if _is_of_wheels(prefix) else place.prefixes
    sourced = set_up(hooked, {**variables, **base})
    names = {"ROS_DISTRO": distribution, "ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3", "RMW_IMPLEMENTATION": RMW}
    changed = {**base, **names, **sourced.variables}
    return Ros2(place.prefixes, python, distribution, RMW, place.source, changed, tuple(dict.fromkeys(sourced.unread)))


def _check_parts(place: _Place, location: str, distribution: str) -> None:
    """Raise UsageError if messages or Fast DDS are missing."""
    prefix = next(filter(_has_rclpy, place.prefixes))
    shares = [prefix / "share" for prefix in place.prefixes]
    missing = [name for name in (*_MESSAGES, RMW) if not any((share / name).is_dir() for share in shares)]
    if missing:
        wheels = f"{prefix}/bin/python -m pip install {' '.join(WHEELS.get(distribution, ()))}"
        apt = f"sudo apt-get install {' '.join(f'ros-{distribution}-{name}' for name in missing).replace('_', '-')}"
        fix = wheels if _is_of_wheels(prefix) else apt
        raise UsageError(f"the ROS 2 {distribution} in {location} has no {', no '.join(missing)}; run {fix}")


def _has_rclpy(prefix: Path) -> bool:
    return (prefix / "share/rclpy/package.xml").is_file()


def _distribution(prefix: Path) -> tuple[str | None, str]:
    """Return the distribution of a prefix, None if it is not known, and the version of its rclpy."""
    match = _VERSION.search(content_or_empty(prefix / "share/rclpy/package.xml", _MAX_FILE_BYTES))
    if match is None:
        return None, "without a version"
    major, rest = match[1].decode(), match[2].decode()
    named = prefix.name if prefix.name in DISTRIBUTIONS else None
    return _RELEASES.get(major, named), f"{major}.{rest}"


def _python(prefix: Path, location: str) -> Path:
    """Return the interpreter that the rclpy of a prefix was built for. Raise UsageError."""
    modules = next(iter(sorted(prefix.glob("lib/python3*/*-packages/rclpy"))), None)
    if modules is None:
        raise UsageError(f"the ROS 2 in {location} has no Python module rclpy; install it again")
    name = modules.parents[1].name
    for path in (prefix / "bin" / name, Path("/usr/bin") / name):
        if path.is_file() and os.access(path, os.X_OK):
            return path
    on_path = program_on_path(name, Path.cwd())
    if on_path is None:
        raise UsageError(
            f"the ROS 2 in {location} needs {name}, which is not on PATH; install it, or set {PYTHON_VARIABLE} to it"
        )
    return on_path


def _is_of_wheels(prefix: Path) -> bool:
    return any(True for _ in _library_folders(prefix))


def _library_folders(prefix: Path) -> Iterator[Path]:
    return iter(sorted(prefix.glob("lib/python3*/site-packages/ros_*.libs")))


def _wheel_variables(prefix: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables of the wheels' bootstrap and of tools, without other ROS 2 environments, which would mix."""
    libraries = [prefix / "lib", *_library_folders(prefix)]
    return {
        **_IS_BOOTSTRAPPED,
        "AMENT_PREFIX_PATH": str(prefix),
        "LD_LIBRARY_PATH": os.pathsep.join(map(str, libraries)),
        "PATH": os.pathsep.join((str(prefix / "bin"), variables.get("PATH") or os.defpath)),
        "PYTHONPATH": "",
    }


def _inherited(variables: Mapping[str, str]) -> dict[str, str]:
    paths = variables.get("PYTHONPATH", "").split(os.pathsep)
    return {"PYTHONPATH": os.pathsep.join(path for path in paths if path and path != _PACKAGE_ROOT)}
