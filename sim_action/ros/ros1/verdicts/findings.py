"""The findings of a launch: the tags of its files, test results, runs of the simulation, and output.

roslaunch reports neither files nor lines. Tags are searched in the text: `$(find PACKAGE)` is replaced, and an include
that depends on arguments is not followed.
"""

from __future__ import annotations

import re
import xml.parsers.expat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import content_or_empty
from sim_action.core.records import dataclass
from sim_action.robot.documents.xml_document import shown_file
from sim_action.ros.result_files import Case, Suite, read_suite
from sim_action.ros.ros1.launch.launch_process import Ending
from sim_action.ros.ros1.launch_request import PROCESS_FILE, SimulationResult, run_folders
from sim_action.ros.ros1.verdicts.launch_output import CallbackError, callback_errors, cleaned_output

RESULTS: Final = "results"  # folder of the results of rostest and its tests, in the folder of the call
LOGS: Final = "log"  # folder of the logs of nodes, in the folder of the call
_MAX_OUTPUT_BYTES: Final = 110_000_000
_MAX_LAUNCH_FILE_BYTES: Final = 4_000_000
_MAX_FILES: Final = 100
_FIND: Final = re.compile(r"\$\(find\s+([^)\s]+)\)")
_WORLD: Final = frozenset({"world_name", "world", "world_file", "/gazebo/world_name"})
_SUBSTITUTION: Final = re.compile(r"\$\([^)]*\)")
DEFAULT_TIME_LIMIT_S: Final = 60.0  # s that rostest gives a test without a time-limit (wiki.ros.org/roslaunch/XML/test)


@dataclass(frozen=True, slots=True)
class LaunchTag:
    """A tag of a launch file."""

    name: str
    attributes: Mapping[str, str]
    place: Location


@dataclass(frozen=True, slots=True)
class LaunchTags:
    """The tags of launch files and of the files that they include; `file`: the first one, as reports show it."""

    file: str
    tags: tuple[LaunchTag, ...] = ()

    @classmethod
    def read(cls, paths: Sequence[Path], packages: Mapping[str, Path]) -> LaunchTags:
        """Read launch files; `packages`: name -> folder of all packages."""
        seen = set[Path]()
        return cls(shown_file(paths[0].resolve()), tuple(tag for path in paths for tag in _tags(path, packages, seen)))

    def node(self, package: str, program: str) -> LaunchTag | None:
        """Return the first tag of a node."""
        attributes = {"pkg": package, "type": program}
        return next(
            (tag for tag in self.tags if tag.name == "node" and attributes.items() <= tag.attributes.items()), None
        )

    def world(self, path: str) -> Location:
        """Return the place that names a world file; without one, the launch file."""
        name = PurePath(path).name
        return next((tag.place for tag in self.tags if _names_world(tag, name)), Location(self.file))


def _names_world(tag: LaunchTag, name: str) -> bool:
    if tag.name == "node":
        return any(word.endswith(f"/{name}") or word == name for word in tag.attributes.get("args", "").split())
    stated = tag.attributes.get("value", tag.attributes.get("default", ""))
    return tag.attributes.get("name") in _WORLD and PurePath(stated).name == name


def _tags(path: Path, packages: Mapping[str, Path], seen: set[Path]) -> Iterator[LaunchTag]:
    path = path.resolve()
    if path in seen or len(seen) == _MAX_FILES:
        return
    seen.add(path)
    for tag in _own_tags(path):
        yield tag
        if tag.name == "include" and (file := _included_file(tag.attributes.get("file", ""), packages)) is not None:
            yield from _tags(file, packages, seen)


def _own_tags(path: Path) -> list[LaunchTag]:
    """Return the tags of a file itself; in broken XML, those before the error."""
    tags: list[LaunchTag] = []
    parser = xml.parsers.expat.ParserCreate()
    file = shown_file(path)

    def begin(name: str, attributes: dict[str, str]) -> None:
        tags.append(LaunchTag(name, attributes, Location(file, parser.CurrentLineNumber)))

    parser.StartElementHandler = begin
    # roslaunch reports the errors in the file.
    with suppress(xml.parsers.expat.ExpatError):
        parser.Parse(content_or_empty(path, _MAX_LAUNCH_FILE_BYTES), True)
    return tags


def _included_file(stated: str, packages: Mapping[str, Path]) -> Path | None:
    names = _FIND.findall(stated)
    if any(name not in packages for name in names):
        return None
    path = _FIND.sub(lambda match: str(packages[match[1]]), stated)
    return Path(path) if "$(" not in path and Path(path).is_file() else None


@dataclass(frozen=True, slots=True)
class TestTag:
    """A `<test>` tag: line, name, time limit in s, and retries. `$(...)` is not replaced."""

    line: int
    name: str
    time_limit: float
    retry: int

    def is_called(self, name: str) -> bool:
        """Return True if a test name can result from this tag, once its `$(...)` are replaced."""
        parts = map(re.escape, _SUBSTITUTION.split(self.name))
        return re.fullmatch(".*".join(parts), name) is not None


def test_tags(path: Path) -> tuple[TestTag, ...]:
    """Return the `<test>` tags of a file itself, in their order; in broken XML, those before the error."""
    return tuple(_tag(tag.place.line or 0, tag.attributes) for tag in _own_tags(path) if tag.name == "test")


def _tag(line: int, attributes: Mapping[str, str]) -> TestTag:
    return TestTag(
        line,
        attributes.get("test-name", ""),
        _number(attributes.get("time-limit"), DEFAULT_TIME_LIMIT_S),
        int(_number(attributes.get("retry"), 0)),
    )


def _number(text: str | None, default: float) -> float:
    try:
        return float(text or default)
    except ValueError:
        return default


@dataclass(frozen=True, slots=True)
class Run:
    """One start of the simulation's node; `result` None: it ended before it wrote one."""

    folder: Path
    result: SimulationResult | None


@dataclass(frozen=True, slots=True)
class TestFindings:
    """The findings of one test; `tag` None: it is in an included file; `methods` None: the test wrote no results."""

    name: str
    tag: TestTag | None = None
    methods: Suite | None = None
    launched: Case | None = None
    run: Run | None = None
    callbacks: tuple[CallbackError, ...] = ()


@dataclass(frozen=True, slots=True)
class Findings:
    """The findings of a launch; `text`: the whole output, without colours."""

    ending: Ending
    exit_code: int | None
    tests: tuple[TestFindings, ...]
    runs: tuple[Run, ...]
    text: str
    callbacks: tuple[CallbackError, ...] = ()


def collect_findings(
    folder: Path, share: str, workspace: Path, tags: Sequence[TestTag], ending: tuple[Ending, int | None]
) -> Findings:
    """Read the folder of a call, whose processes see packages in `share`, and the user's are in `workspace`.

    The output is kept without `share`. `ending`: of the launch, with the exit code.
    """

    def callbacks(run: Run | None) -> tuple[CallbackError, ...]:
        return callback_errors(folder / LOGS, _process(run), workspace) if (folder / LOGS).is_dir() else ()

    results = folder / RESULTS
    reported = [suite for path in sorted(results.rglob("rostest-*.xml")) if (suite := read_suite(path))]
    launched = {case.name.removeprefix("test"): case for suite in reported for case in suite.cases}
    written = {path.stem.removeprefix("rosunit-"): path for path in sorted(results.rglob("rosunit-*.xml"))}
    runs = [Run(run, SimulationResult.read(run)) for run in run_folders(folder)]
    names = list(dict.fromkeys((*launched, *written))) or [tag.name for tag in tags]
    of_tests = _runs_of(names, written, runs)
    tests = tuple(
        TestFindings(
            name,
            next((tag for tag in tags if tag.is_called(name)), None),
            read_suite(written[name]) if name in written else None,
            launched.get(name),
            of_tests.get(name),
            callbacks(of_tests.get(name)),
        )
        for name in names
    )
    output = content_or_empty(folder / "output.txt", _MAX_OUTPUT_BYTES)
    text = "\n".join((*(suite.output for suite in reported), output.decode(errors="replace")))
    text = cleaned_output(text).replace(f"{share}/", "")
    return Findings(*ending, tests, tuple(runs), text, callbacks(None))


def _process(run: Run | None) -> str | None:
    try:
        return (run.folder / PROCESS_FILE).read_text() if run else None
    except OSError:
        return None


def _runs_of(names: Sequence[str], written: dict[str, Path], runs: Sequence[Run]) -> dict[str, Run]:
    matched = {name: run for name, path in written.items() for run in runs if _began(run) <= path.stat().st_mtime}
    left = (run for run in runs if run not in matched.values())
    return {**dict(zip((name for name in names if name not in matched), left, strict=False)), **matched}


def _began(run: Run) -> float:
    try:
        return (run.folder / PROCESS_FILE).stat().st_mtime
    except OSError:
        return run.folder.stat().st_mtime
