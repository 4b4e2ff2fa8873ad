"""The build of a workspace's own messages on the wheels of ROS 2, which `sim-action ros2 prepare` does.

The packages are built one after the other with the generators of the wheels, into the `install` folder of the workspace
as colcon would do it, so everything that looks for packages finds them. A package is built again when its files, the
packages that it needs, or the wheels have changed. Packages in Python need no build. Packages in C++ are built if
packages in Python or with messages need them, as tf2_ros_py needs tf2, and if all needs exist: the wheels lack rclcpp.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import yaml
from yaml import YAMLError

from sim_action.core.errors import Location, UsageError
from sim_action.core.files import content_or_empty
from sim_action.core.process import program_on_path
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot.documents.package_search import PACKAGE_FILE, folders_below
from sim_action.ros.ros2.installation import Ros2
from sim_action.ros.ros2.packages import INSTALL, imported, read_package, workspace_of
from sim_action.scenario.part_reader import actors_of

GENERATORS: Final = (
    *("ament-cmake", "ament-cmake-core", "ament-cmake-export-definitions", "ament-cmake-export-dependencies"),
    *("ament-cmake-export-include-directories", "ament-cmake-export-interfaces", "ament-cmake-export-libraries"),
    *("ament-cmake-export-link-flags", "ament-cmake-export-targets", "ament-cmake-gen-version-h"),
    *("ament-cmake-include-directories", "ament-cmake-libraries", "ament-cmake-python", "ament-cmake-ros"),
    *("ament-cmake-target-dependencies", "ament-cmake-test", "ament-cmake-version", "ament-cmake-gtest"),
    *("ament-cmake-gmock", "ament-cmake-pytest", "ament-package", "python-cmake-module"),
    *("rosidl-core-generators", "rosidl-default-generators"),
)
"""The wheels that build messages, without `ros-DISTRIBUTION-`."""

_PROGRAMS: Final = ("cmake", "ninja", "g++")
_STAMP: Final = ".sim-action"
_LAYOUT: Final = ".colcon_install_layout"
_MAX_FILE_BYTES: Final = 1_000_000
_LAST_LINES: Final = 20
# The Python of the machine on which the wheels were built.
_BUILDERS_PYTHON: Final = re.compile(r"/opt/python/cp\d+-cp\d+/(include|lib)/python3\.\d+(?:/site-packages)?")
_DEPENDS: Final = ("depend", "build_depend", "build_export_depend", "exec_depend", "run_depend")
_INTERFACES: Final = re.compile(r"\brosidl_generate_interfaces\s*\(")
_PLAIN: Final = frozenset(
    {
        *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
        *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
    }
)
_FIELD: Final = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>=.*|\S.*)?"
)


@dataclass(frozen=True, slots=True)
class Source:
    """A package in source; `needs`: those in its package.xml; `build_needs`: of them, those in CMakeLists.txt."""

    name: str
    folder: Path
    needs: frozenset[str]
    build_needs: frozenset[str]
    has_messages: bool
    is_built: bool


def sources_in(workspace: Path) -> dict[str, Source]:
    """Return the packages of a workspace and its .repos files, each after the packages it needs. Raise UsageError."""
    below = workspace / "src" if (workspace / "src").is_dir() else workspace
    places = {folder.resolve(): None for folder in (below, *_imports(workspace))}
    outer = [place for place in places if not any(other in place.parents for other in places)]
    sources = dict[str, Source]()
    for place in outer:
        for name, folders in folders_below(place, inside_packages=False).packages.items():
            if len(folders) > 1 or name in sources:
                both = [*(source.folder for source in (sources.get(name),) if source), *folders]
                where = " and ".join(str(folder.relative_to(workspace.resolve())) for folder in both[:3])
                raise UsageError(f"the workspace has {len(both)} packages '{name}': {where}; remove or rename one")
            sources[name] = _source(name, folders[0])
    if not sources:
        raise UsageError(f"{workspace} has no packages: no folder has a {PACKAGE_FILE}")
    graph = {name: sorted(source.needs & sources.keys() - {name}) for name, source in sorted(sources.items())}
    try:
        return {name: sources[name] for name in TopologicalSorter(graph).static_order()}
    except CycleError as error:
        raise UsageError(
            f"packages need each other in a circle: {' -> '.join(error.args[1][::-1])}; remove one <depend>"
        ) from None


def _imports(workspace: Path) -> Iterator[Path]:
    """Yield the folders into which `vcs import` puts what the .repos files of a workspace name."""
    for file in sorted({*workspace.glob("*.repos"), *workspace.glob("*/*.repos"), *workspace.glob("src/*/*.repos")}):
        with suppress(YAMLError, UnicodeDecodeError):
            content = yaml.safe_load(content_or_empty(file, _MAX_FILE_BYTES))
            names = content.get("repositories") if isinstance(content, dict) else None
            for name in names if isinstance(names, dict) else ():
                for folder in (workspace / "src" / str(name), workspace / str(name)):
                    if folder.resolve().is_relative_to(workspace.resolve()):
                        yield folder


def _source(name: str, folder: Path) -> Source:
    path = folder / PACKAGE_FILE
    try:
        root = ET.fromstring(content_or_empty(path, _MAX_FILE_BYTES))  # noqa: S314 - of the user's own package
    except ET.ParseError as error:
        place = Location(str(path), error.position[0])
        raise UsageError(f"{place}: {PACKAGE_FILE} of '{name}' is not XML: {str(error).partition(':')[0]}") from None
    needs = frozenset((element.text or "").strip() for tag in _DEPENDS for element in root.iter(tag))
    cmake = re.sub(r"#.*", "", content_or_empty(folder / "CMakeLists.txt", _MAX_FILE_BYTES).decode("utf-8", "replace"))
    is_built = bool(cmake.strip()) and not read_package(name, folder).is_python
    build_needs = needs & set(re.findall(r"\w+", cmake))
    has_messages = bool(_INTERFACES.search(cmake)) and bool(_message_files(folder))
    return Source(name, folder, needs, build_needs, has_messages, is_built)


def _message_files(folder: Path) -> list[Path]:
    paths = (path for kind in ("msg", "srv", "action") for path in folder.rglob(f"{kind}/*.{kind}"))
    return sorted(path for path in paths if not path.relative_to(folder).parts[0].startswith("test"))


def problems(sources: Mapping[str, Source], prefixes: tuple[Path, ...]) -> Iterator[tuple[str, Location]]:
    """Yield what prevents a build, each with its place: packages that are missing, and messages that do not parse."""
    lacks = _lacking(sources, prefixes)
    for source in sources.values():
        if not source.has_messages:
            continue
        if need := lacks.get(source.name):
            message = f"'{source.name}' needs the package '{need}', which neither the workspace nor ROS 2 has"
            remedy = "add its source to src (with a .repos file: vcs import src < FILE.repos), or remove the <depend>"
            yield f"{message}; {remedy}", Location(str(source.folder / PACKAGE_FILE), None)
        for path in _message_files(source.folder):
            yield from _problems_of_file(path, source, sources, prefixes)


def _lacking(sources: Mapping[str, Source], prefixes: Iterable[Path]) -> dict[str, str]:
    """Return the packages that cannot be built, each with the first package that it lacks."""
    lacks = dict[str, str]()
    for source in sources.values():
        for need in sorted(source.build_needs if source.is_built else ()):
            is_there = need in sources or any((prefix / "share" / need / PACKAGE_FILE).is_file() for prefix in prefixes)
            if need in lacks or not is_there:
                lacks.setdefault(source.name, need)
    return lacks


def _packages_to_build(sources: Mapping[str, Source], names: Collection[str] | None) -> list[Source]:
    """Return the packages to build, with their needs: those in `names`; None: with messages, or needed in Python."""
    first = [source for source in sources.values() if source.has_messages or not source.is_built]
    selected = {source.name for source in first} if names is None else {*names} & sources.keys()
    for source in reversed(list(sources.values())):
        selected |= source.needs & sources.keys() if source.name in selected else set()
    return [source for source in sources.values() if source.name in selected and source.is_built]


def _problems_of_file(
    path: Path, source: Source, sources: Mapping[str, Source], prefixes: tuple[Path, ...]
) -> Iterator[tuple[str, Location]]:
    shares = {need: folder for need in source.needs for folder in _shares(need, sources, prefixes)}
    for number, line in enumerate(content_or_empty(path, _MAX_FILE_BYTES).decode("utf-8", "replace").splitlines(), 1):
        text = re.sub(r"""^((?:[^"'#]|"[^"]*"|'[^']*')*)#.*""", r"\1", line).strip()
        if not text or text == "---":
            continue
        place = Location(str(path), number)
        match = _FIELD.fullmatch(text)
        if match is None:
            yield f"'{text}' is not a field of a message; write TYPE NAME, such as float64 speed", place
            continue
        owner, slash, short = match["type"].partition("/")
        if not slash and owner not in _PLAIN and not (source.folder / "msg" / f"{owner}.msg").is_file():
            own = {path.stem for path in source.folder.glob("msg/*.msg")}
            yield f"there is no type '{owner}'{did_you_mean(owner, [*_PLAIN, *own])}", place
        elif slash and owner != source.name:
            name = short.rpartition("/")[2]
            if owner not in shares:
                yield f"the package '{owner}' of the type is not named by a <depend> in {PACKAGE_FILE}", place
            elif not (shares[owner] / "msg" / f"{name}.msg").is_file():
                names = [path.stem for path in shares[owner].glob("msg/*.msg")]
                yield f"the package '{owner}' has no message '{name}'{did_you_mean(name, names)}", place


def _shares(name: str, sources: Mapping[str, Source], prefixes: tuple[Path, ...]) -> Iterator[Path]:
    if name in sources:
        yield sources[name].folder
    yield from (share for prefix in prefixes if (share := prefix / "share" / name).is_dir())


def prepare(
    workspace: Path, ros: Ros2, cache: Path, environment: Mapping[str, str], names: Collection[str] | None = None
) -> Iterator[str]:
    """Build the packages that have changed, and yield a line about each package.

    Raise UsageError. `cache`: a folder for the files of builds; `environment`: the variables that builds may see;
    `names`: the packages to build, with all packages that they need; None: all.
    """
    sources = sources_in(workspace)
    if messages := [f"{place}: {message}" for message, place in problems(sources, ros.prefixes)]:
        raise UsageError("; ".join(messages[:5]))
    install, lacks = workspace / INSTALL, _lacking(sources, ros.prefixes)
    selected = _packages_to_build(sources, names)
    built = [source.name for source in selected if source.name not in lacks]
    for name in built:
        if (install / name).exists() and not (install / name / _STAMP).is_file():
            raise UsageError(f"{install / name} was built by another tool; build it with that, or remove the folder")
    if built:
        _require_tools(ros)
        install.mkdir(exist_ok=True)
        if not (install / _LAYOUT).exists():
            (install / _LAYOUT).write_text("isolated\n", encoding="utf-8")
    stamps: dict[str, str] = {}
    wheels: Path | None = None
    yield from (
        _why_not(source, lacks, selected) for source in sources.values() if names is None and source not in selected
    )
    for source in selected:
        name = source.name
        if name in lacks:
            yield _why_not(source, lacks, selected)
            continue
        stamps[name] = stamp = _stamp(source, ros, [stamps[need] for need in sorted(source.needs & stamps.keys())])
        if content_or_empty(install / name / _STAMP, _MAX_FILE_BYTES) == stamp.encode():
            yield f"{name}: unchanged"
            continue
        shutil.rmtree(install / name, ignore_errors=True)
        wheels = wheels or _prefix_of_builds(ros, cache)
        others = [install / other for other in built if (install / other).is_dir()]
        _build(source, others, wheels, install / name, ros=ros, environment=environment)
        (install / name).mkdir(exist_ok=True)  # of a package that installs nothing
        (install / name / _STAMP).write_text(stamp, encoding="utf-8")
        yield f"{name}: built"


def _why_not(source: Source, lacks: Mapping[str, str], selected: Collection[Source]) -> str:
    reason = "it needs no build" if not source.is_built else "no package in Python needs it"
    if source in selected:
        reason = f"it needs '{lacks[source.name]}', which is not there or cannot be built"
    return f"{source.name}: not built, because {reason}"


def needed_by(scenarios: Iterable[Path]) -> dict[Path, set[str]]:
    """Return workspace -> packages to build that programs of readable scenarios import; a run names the others."""
    packages = dict[Path, set[str]]()
    for path in scenarios:
        with suppress(YAMLError, UnicodeDecodeError, PathError, UsageError):
            for nodes in _nodes_of(yaml.safe_load(content_or_empty(path, _MAX_FILE_BYTES))):
                stated = nodes.get("workspace")
                folder = workspace_of(stated if isinstance(stated, str) else None, Workspace.around(path))
                sources = sources_in(folder)
                stated_nodes = nodes.get("nodes")
                items = stated_nodes if isinstance(stated_nodes, list) else ()
                listed = (node.get("file") if isinstance(node, dict) else node for node in items)
                programs = {path.parent / node for node in listed if isinstance(node, str) and node.endswith(".py")}
                programs.update(file for source in sources.values() for file in source.folder.rglob("*.py"))
                built = {name for name, source in sources.items() if source.is_built}
                names = {name.partition(".")[0] for program in programs for name in imported(program)}
                packages.setdefault(folder, set()).update(built & names)
    return {folder: names for folder, names in packages.items() if names}


def _nodes_of(content: Any) -> Iterator[dict[str, Any]]:
    """Yield the values of `ros2` in a scenario, of the robot and of its actors."""
    if isinstance(content, dict):
        for robot in (content, *(actors_of(content) or ())):
            commands = robot.get("commands") if isinstance(robot, dict) else None
            for source in commands if isinstance(commands, list) else [commands]:
                if isinstance(source, dict) and isinstance(source.get("ros2"), dict):
                    yield source["ros2"]


def _require_tools(ros: Ros2) -> None:
    if missing := [program for program in _PROGRAMS if program_on_path(program) is None]:
        raise UsageError(
            f"a build needs {', '.join(missing)}; run sudo apt-get install cmake ninja-build g++ (or pip install cmake "
            "ninja)"
        )
    if not (ros.prefix / "share/rosidl_default_generators").is_dir() or not list(
        ros.prefix.glob("lib/python3*/site-packages/catkin_pkg")
    ):
        wheels = " ".join(f"ros-{ros.distribution}-{name}" for name in GENERATORS)
        raise UsageError(
            f"{ros.prefix} has no generators of messages; run {ros.python} -m pip install {wheels} catkin_pkg 'empy<4'"
        )


def _stamp(source: Source, ros: Ros2, others: list[str]) -> str:
    digest = hashlib.sha256(repr((str(ros.prefix), ros.distribution, others)).encode())
    for path in sorted(source.folder.rglob("*")):
        if path.is_file():
            # Of a file too long to be read, the size and the time stand for its content.
            state = path.stat()
            content = content_or_empty(path, _MAX_FILE_BYTES) or (state.st_size, state.st_mtime_ns)
            digest.update(repr((str(path.relative_to(source.folder)), content)).encode())
    return digest.hexdigest()


def _prefix_of_builds(ros: Ros2, cache: Path) -> Path:
    """Return a copy of the wheels' prefix whose CMake files name the Python here instead of the builder's."""
    paths = "import sysconfig; paths = sysconfig.get_paths(); print(paths['include'], paths['purelib'], sep='\\n')"
    done = subprocess.run(  # noqa: S603 - the Python of ROS 2
        [str(ros.python), "-c", paths], capture_output=True, text=True, check=True
    )
    folders = dict(zip(("include", "lib"), done.stdout.splitlines(), strict=True))
    prefix = cache / hashlib.sha256(f"{ros.prefix} {folders}".encode()).hexdigest()[:16]
    shutil.rmtree(prefix, ignore_errors=True)
    shutil.copytree(ros.prefix / "share", prefix / "share", symlinks=True)
    for name in ("bin", "include", "lib", "tools"):
        if (ros.prefix / name).is_dir():
            (prefix / name).symlink_to(ros.prefix / name)
    for path in prefix.glob("share/*/cmake/*.cmake"):
        text = path.read_text(encoding="utf-8", errors="replace")
        if _BUILDERS_PYTHON.search(text):
            path.write_text(_BUILDERS_PYTHON.sub(lambda match: folders[match[1]], text), encoding="utf-8")
    return prefix


def _build(
    source: Source, others: list[Path], wheels: Path, install: Path, *, ros: Ros2, environment: Mapping[str, str]
) -> None:
    """Build a package into its own prefix, next to `wheels`. Raise UsageError with the last lines of the build."""
    paths = os.pathsep.join(map(str, (*others, wheels)))
    folder = wheels.with_name(f"{wheels.name}-{source.name}")
    shutil.rmtree(folder, ignore_errors=True)
    libraries = [str(other / "lib") for other in others]
    python_paths = [str(path) for other in others for path in other.glob("lib/python3*/site-packages")]
    variables = {
        **environment,
        **ros.variables,
        "AMENT_PREFIX_PATH": paths,
        "CMAKE_PREFIX_PATH": paths,
        "LD_LIBRARY_PATH": os.pathsep.join([*libraries, ros.variables.get("LD_LIBRARY_PATH", "")]),
        "PYTHONPATH": os.pathsep.join(filter(None, [*python_paths, ros.variables.get("PYTHONPATH", "")])),
    }
    cmake = str(program_on_path("cmake"))
    configure = [cmake, "-S", str(source.folder), "-B", str(folder), "-G", "Ninja", "-DBUILD_TESTING=OFF"]
    configure += [f"-DCMAKE_INSTALL_PREFIX={install}", "-DCMAKE_BUILD_TYPE=Release"]
    configure += [f"-D{name}={ros.python}" for name in ("Python3_EXECUTABLE", "PYTHON_EXECUTABLE")]
    for command in (configure, [cmake, "--build", str(folder), "--target", "install"]):
        done = subprocess.run(  # noqa: S603 - the build files of the user, which the permission gate has let through
            command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        if done.returncode:
            lines = done.stdout.strip().splitlines()
            shown = "\n".join(lines[-_LAST_LINES:])
            place = re.search(rf"^({re.escape(str(source.folder))}[^:\s]*):(\d+)", done.stdout, re.MULTILINE)
            location = Location(place[1], int(place[2])) if place else Location(str(source.folder), None)
            count = counted(min(len(lines), _LAST_LINES), "line")
            raise UsageError(f"{location}: the build of '{source.name}' failed; the last {count}:\n{shown}")
