"""The set-up of the action against pip and uv, which install the same packages: `python -m tools.bench.set_up`.

Cold: nothing is on this machine, and all wheels come from the package index. Cached: the wheels are there, as after the
step that restores them. All ways take turns in one run; the least time counts.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from tools.bench.table import Goal, Measurement, NotMeasuredError, print_table

ROOT: Final = Path(__file__).resolve().parents[2]
COLD_GOAL_S: Final = 15
CACHED_GOAL_S: Final = 3
_ROUNDS: Final = 2
_PIP: Final = ("--quiet", "--disable-pip-version-check", "--require-hashes", "--only-binary", ":all:", "--no-deps")
_SCENARIO: Final = ROOT / "examples/turtlebot3/straight_line.sim.yml"


class _Machine:
    """An empty home folder, and one RUNNER_TEMP for each installation."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.home = folder / "home"
        self.workspace = folder / "workspace"
        self.workspace.mkdir(parents=True)
        shutil.copy(_SCENARIO, self.workspace)
        self.python = Path(sys.base_prefix, "bin/python3.11")
        if not self.python.exists():
            raise NotMeasuredError("the actions ask for Python 3.11, and this is another one")
        self._number = 0

    def new_folder(self) -> Path:
        """Return an empty folder."""
        self._number += 1
        folder = self._folder / str(self._number)
        folder.mkdir()
        return folder

    def run(self, *command: object, **variables: object) -> None:
        """Run a command in the workspace, without the variables of this process that an action would not have."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
        given = {"HOME": str(self.home), **{name: str(value) for name, value in variables.items()}}
        words = [str(word) for word in command]
        subprocess.run(words, cwd=self.workspace, env={**kept, **given}, check=True, capture_output=True)

    def lock(self) -> Path:
        """Return a lock file of the packages that the action chooses for the workspace."""
        from action.lock import chosen_locks, entries_here, text_of, without_engines

        path = self._folder / "chosen.lock"
        path.write_text(
            text_of(
                without_engines(entries_here(chosen_locks(ROOT / "action/locks/requirements.lock", "")), ["mujoco"])
            )
        )
        return path


def _ours(machine: _Machine) -> Path:
    """Run both steps of the action, and return the interpreter."""
    temp = machine.new_folder()
    outputs = temp / "outputs"
    variables: dict[str, object] = {
        "RUNNER_OS": "Linux",
        "RUNNER_ARCH": "X64",
        "RUNNER_TEMP": temp,
        "GITHUB_WORKSPACE": machine.workspace,
        "GITHUB_OUTPUT": outputs,
        "GITHUB_EVENT_NAME": "push",
        "INPUT_CACHE": "true",
        "PIP_NO_CACHE_DIR": "1",
        "LOCK": ROOT / "action/locks/requirements.lock",
    }
    script = ROOT / "action/environment.py"
    machine.run(machine.python, "-I", script, "look", **variables)
    machine.run(machine.python, "-I", script, "install", **variables, PLAN=_output(outputs, "plan"))
    return Path(_output(outputs, "python"))


def _output(file: Path, name: str) -> str:
    lines = file.read_text(encoding="utf-8").splitlines()
    return next(line.partition("=")[2] for line in lines if line.startswith(f"{name}="))


def _pip_cold(machine: _Machine) -> None:
    """A virtual environment into which pip installs from the index."""
    folder = machine.new_folder()
    machine.run(machine.python, "-I", "-m", "venv", "--without-pip", folder)
    install = (machine.python, "-I", "-m", "pip", "--python", folder / "bin/python", "install", "--no-compile")
    machine.run(*install, *_PIP, "--no-cache-dir", "--requirement", machine.lock())


def _pip_cached(machine: _Machine) -> None:
    """The same from the folder of the wheels that the action has kept."""
    folder = machine.new_folder()
    [wheels] = (machine.home / ".cache/sim-action-wheels").iterdir()
    machine.run(machine.python, "-I", "-m", "venv", "--without-pip", folder)
    install = (machine.python, "-I", "-m", "pip", "--python", folder / "bin/python", "install", "--no-compile")
    machine.run(*install, *_PIP, "--no-index", "--find-links", wheels, "--requirement", machine.lock())


def _uv(machine: _Machine, *options: object) -> None:
    """The uv of a folder `uv`, with the index of pip."""
    folder = machine.new_folder()
    uv = machine.home / "uv/bin/uv"
    machine.run(uv, "venv", "--quiet", "--python", machine.python, folder / "venv")
    install = (uv, "pip", "install", "--quiet", "--python", folder / "venv/bin/python", "--require-hashes", "--no-deps")
    settings = {"UV_NATIVE_TLS": "true", "UV_LINK_MODE": "copy", "UV_CACHE_DIR": machine.home / "uv-cache"}
    machine.run(*install, "--only-binary", ":all:", *options, "--requirement", machine.lock(), **settings)


def _uv_cold(machine: _Machine) -> None:
    """A virtual environment into which uv installs; pip fetches uv first."""
    for name in ("uv", "uv-cache"):
        shutil.rmtree(machine.home / name, ignore_errors=True)
    target = ("--no-deps", "--no-cache-dir", "--target", machine.home / "uv")
    machine.run(machine.python, "-I", "-m", "pip", "install", "--quiet", *target, "uv")
    _uv(machine)


def _uv_cached(machine: _Machine) -> None:
    """The same with uv and its own cache, whose hashes it does not compare again."""
    _uv(machine, "--offline")


def _ours_cold(machine: _Machine) -> None:
    shutil.rmtree(machine.home / ".cache/sim-action-wheels", ignore_errors=True)
    _ours(machine)


def _timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return the wall time and the CPU time of a call with its children, in s."""
    began, used = time.perf_counter(), _cpu_s()
    call()
    return time.perf_counter() - began, _cpu_s() - used


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _side_by_side(
    name: str, goal_s: float, machine: _Machine, ways: Mapping[str, Callable[[_Machine], object]]
) -> Goal:
    """Measure several ways in turns; the first one is ours."""
    took: dict[str, list[tuple[float, float]]] = {}
    reasons: dict[str, str] = {}
    for _ in range(_ROUNDS):
        for way, call in ways.items():
            try:
                took.setdefault(way, []).append(_timed(partial(call, machine)))
            except subprocess.CalledProcessError as error:
                reasons[way] = (error.stderr.decode("utf-8", "replace").strip().splitlines() or ["it failed"])[-1]
    [ours, *_] = ways
    if ours in reasons:
        raise NotMeasuredError(f"the action could not install: {reasons[ours]}")
    texts = []
    for way, found in took.items():
        seconds, cpu = min(found) if found else (0.0, 0.0)
        texts.append(f"{way} {seconds:.1f} s, CPU {cpu:.1f} s" if found else f"{way} not measured: {reasons[way]}")
    return Goal(name, min(took[ours])[0], goal_s, "; ".join(texts))


def set_up_costs(folder: Path) -> Iterator[Goal | str]:
    """Both cases, with the speed of the index, and the whole time until the first scenario has ended."""
    machine = _Machine(folder / "set-up")
    from action.lock import entries_here, text_of

    [engine] = [entry for entry in entries_here([ROOT / "action/locks/requirements.lock"]) if entry.name == "pybullet"]
    lock = machine.new_folder() / "engine.lock"
    lock.write_text(text_of([engine]), encoding="utf-8")
    into = machine.new_folder()
    fetch = (machine.python, "-I", "-m", "pip", "download", *_PIP, "--no-cache-dir", "--dest", into)
    seconds, _ = _timed(lambda: machine.run(*fetch, "--requirement", lock))
    megabytes = sum(wheel.stat().st_size for wheel in into.iterdir()) / 1e6
    yield f"     the package index: one wheel of {megabytes:.0f} MB in {seconds:.1f} s with pip"
    cold = {"ours": _ours_cold, "pip": _pip_cold, "uv": _uv_cold}
    yield _side_by_side("set-up, cold", COLD_GOAL_S, machine, cold)
    cached = {"ours": _ours, "pip": _pip_cached, "uv": _uv_cached}
    yield _side_by_side("set-up, wheels cached", CACHED_GOAL_S, machine, cached)
    yield from _first_scenario(machine)


def _first_scenario(machine: _Machine) -> Iterator[str]:
    """The first and the second scenario after the set-up: the first one compiles the modules that it imports."""
    source = machine.new_folder()
    shutil.copytree(ROOT / "sim_action", source / "sim_action", ignore=shutil.ignore_patterns("__pycache__"))
    python = _ours(machine)
    run = (python, "-P", "-m", "sim_action", "run", "--no-report", _SCENARIO.name)
    first, second = (_timed(lambda: machine.run(*run, PYTHONPATH=source)) for _ in range(2))
    both = f"{first[0]:.1f} s, CPU {first[1]:.1f} s; the second: {second[0]:.1f} s, CPU {second[1]:.1f} s"
    yield f"     the first scenario after the set-up: {both}"


def main() -> None:
    """Print the lines of this measurement alone."""
    with tempfile.TemporaryDirectory() as name:
        sys.exit(not print_table([Measurement("set-up", lambda: set_up_costs(Path(name)))]))


if __name__ == "__main__":
    main()
