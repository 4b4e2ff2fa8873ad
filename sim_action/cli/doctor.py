"""`sim-action doctor`."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Final, Literal

import click

from sim_action.app.catalogue import package_parts
from sim_action.app.library import run
from sim_action.assertions import ASSERTIONS
from sim_action.assertions.distance import Travel
from sim_action.commands import COMMANDS
from sim_action.core.errors import ExitCode, SimActionError, UsageError
from sim_action.core.files import cache_folder
from sim_action.core.process import usable_cores
from sim_action.core.provenance import platform_name
from sim_action.core.records import dataclass
from sim_action.core.registry import PackageProblem
from sim_action.core.version import PACKAGE_FOLDER, __version__
from sim_action.core.wording import counted, log_line, system_reason
from sim_action.engines import ENGINES, installed, named_version
from sim_action.runner.isolation.child_process import most_children, scratch_folder
from sim_action.runner.process_pool import child_type_here
from sim_action.scenario.model import MEMORY
from sim_action.scenario.written import Scenario
from sim_action.sensors import SENSORS


@click.command()
def doctor() -> ExitCode:
    """Look at this installation, and say how to get parts that are missing.

    It looks at engines, extras, ROS, limits and folders. Each engine drives a robot for a moment.

    Exit code: 0 scenarios can run; 1 something prevents it.
    """
    marks = {"good": "ok", "missing": "-", "bad": "!"}
    colours = {"good": "green", "missing": None, "bad": "red"}
    states: list[str] = []
    for finding in (*findings(), _ros(1), _ros(2)):
        mark = click.style(f"{marks[finding.state]:<3}", fg=colours[finding.state])
        click.echo(f"{mark}{finding.name:<16} {log_line(finding.text)}")
        states.append(finding.state)
    return ExitCode.of_command(has_failed="bad" in states)


def _ros(version: int) -> Finding:
    name = f"ROS {version}"
    if sys.platform != "linux":
        return Finding("missing", name, "its nodes run on Linux only")
    from sim_action.ros.ros1 import installation as ros1
    from sim_action.ros.ros2 import installation as ros2

    try:
        if version == 2:
            return Finding("good", name, str(ros2.find_ros()))
        ros = ros1.find_ros()
    except UsageError as error:
        return Finding("missing", name, str(error))
    return Finding("good", name, f"in {ros.prefix}, for {ros.python}")


State = Literal["good", "missing", "bad"]
"""The state of one thing.

- good: it works.
- missing: it is not there, or is less than usual; scenarios that do not need it run.
- bad: scenarios cannot run.
"""

_EXTRAS: Final = {
    "mcap": ("mcap", "recordings for Foxglove (--record mcap)"),
    "video": ("av", "recordings as GIF and MP4 (--record gif, mp4)"),
    "rosbags": ("rosbags", "replays of ROS bags"),
    "policy": ("onnxruntime", "learned policies"),
    "dask": ("distributed", "runs on a cluster (--cluster)"),
}
"""Extra -> a package that it installs, and what it is for."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at; `text` has the remedy if there is one."""

    state: State
    name: str
    text: str


def findings() -> Iterator[Finding]:
    """Yield what was found, one thing after the other."""
    installation = f"{__version__} in {PACKAGE_FOLDER}"
    yield Finding("good", "sim-action", f"{installation}, Python {platform.python_version()}, {platform_name()}")
    engines = installed()
    for name, engine in ENGINES.items():
        yield (_engine(name) if name in engines else Finding("missing", name, f"not installed; {engine.install_hint}"))
    if not engines:
        yield Finding("bad", "engines", "no physics engine is installed: no scenario can run")
    for extra, (package, purpose) in _EXTRAS.items():
        is_there = find_spec(package) is not None
        how = purpose if is_there else f"not installed; pip install 'sim-action[{extra}]' adds {purpose}"
        yield Finding("good" if is_there else "missing", extra, how)
    yield from _package_parts()
    yield from _limits()
    yield from _folders()


def _engine(engine: str) -> Finding:
    """Run the built-in robot for a moment, in a process of its own, as every scenario runs."""
    scenario = Scenario(
        name="doctor",
        robot={"model": "turtlebot3_burger"},
        commands={"twist": [{"linear": 1.0}]},
        expect=[Travel(at_least=0.001)],
        time_limit=1,
        backend=engine,
    )
    try:
        outcome = run(scenario, report=False)[0]
    except (SimActionError, OSError) as error:
        return Finding("bad", engine, f"cannot run: {error}")
    if outcome.passed:
        return Finding("good", engine, f"{named_version(engine)}: a robot drove")
    return Finding("bad", engine, f"{named_version(engine)}: a robot should have driven; {outcome.record.ending}")


def _package_parts() -> Iterator[Finding]:
    """Import the parts of installed packages. Scenarios that use none run without them."""
    for table in (ASSERTIONS, COMMANDS, SENSORS):
        for part, kind in package_parts(table):
            is_good = not isinstance(kind, PackageProblem)
            yield Finding(
                "good" if is_good else "missing", part.name, f"{table.kind} of {part.package}" if is_good else str(kind)
            )


def _limits() -> Iterator[Finding]:
    cores = usable_cores()
    children = most_children(child_type_here(), cores)
    text = f"{counted(cores, 'core')}; {counted(children, 'scenario')} at the same time"
    if children < cores:
        yield Finding(
            "missing", "parallel runs", f'{text}: raise the limits of open files and processes ("ulimit -n", "-u")'
        )
    else:
        yield Finding("good", "parallel runs", text)
    if sys.platform == "win32":
        return
    # Windows lacks it.
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most not in (resource.RLIM_INFINITY, -1) and most < MEMORY:
        allowed = f"{most / 2**30:.3g} GiB of address space, and a scenario may use {MEMORY >> 30}"
        yield Finding(
            "missing", "memory", f'{allowed}: raise the limit ("ulimit -v"), or set memory_limit in scenarios'
        )


def _folders() -> Iterator[Finding]:
    yield _temporary_files()
    if (cache := cache_folder("meshes")) is None:
        yield Finding("missing", "cache", "there is no home folder; hulls of meshes are made in each run")
        return
    size = sum(path.stat().st_size for path in cache.rglob("*") if path.is_file())
    used = f"{size / 1e6:.3g} MB of hulls of meshes in {cache.parent}"
    existing = next(folder for folder in (cache, *cache.parents) if folder.exists())
    writable = os.access(existing, os.W_OK)
    remedy = "" if writable else "; it cannot be written, and hulls are made in each run: set XDG_CACHE_HOME"
    yield Finding("good" if writable else "missing", "cache", used + remedy)


def _temporary_files() -> Finding:
    """Make the folder that each scenario has for its files."""
    try:
        with scratch_folder() as name:
            folder = Path(name).parent
            free = shutil.disk_usage(folder).free
    except OSError as error:
        message = f"{tempfile.gettempdir()} cannot be written: {system_reason(error)}; set TMPDIR to another folder"
        return Finding("bad", "temporary files", message)
    return Finding("good", "temporary files", f"{folder}, {free / 1e9:.3g} GB free")
