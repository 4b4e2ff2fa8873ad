"""Compare `sim-action run` with hand-written tests: one test, a suite, variations, a gate, steps, and the husky.

The hand-written tests are in `with_pybullet/` and `with_mujoco/`: the same robot, time step, settling and ramp of
speed. They read what their assertions need. pytest writes JUnit XML. It loads no plugin except pytest-xdist where that
is used: an environment with only pytest and the engine costs the same.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tools.bench.by_hand.processes import Command, compared, take_turns
from tools.bench.by_hand.steps import step_costs
from tools.bench.table import NotMeasuredError, Ratio

ENGINES: Final = ("pybullet", "mujoco")
SUITE: Final = 32
GATES: Final = (30, 300)
"""The numbers of runs of two gates; their difference is the cost of further runs."""

PYTHON_VARIABLE: Final = "SCENARIO_EXECUTION_PYTHON"
"""The environment variable with the Python that scenario_execution is installed for."""

_FOLDER: Final = Path(__file__).parent

_ONE: Final = """\
name: burger drives 1.5 m
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}]
time_limit: 30 s
backend: {engine}
"""

_SUITE: Final = """\
name: burger drives upright at {speed:.2f} m/s
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: {speed:.2f}}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}, {{upright: {{max_tilt: 10 deg}}}}]
duration: 4 s
time_limit: 4 s
backend: {engine}
"""

_VARIATIONS: Final = """\
name: burger drives upright
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1 m}}}}, {{upright: {{max_tilt: 10 deg}}}}]
duration: 2 s
time_limit: 2 s
backend: {engine}
variations: {{robot.pose.yaw: {{uniform: [-1 deg, 1 deg], samples: {samples}}}}}
"""

# Its runs must differ: a heading has no effect on a burger that drives straight on.
_GATE: Final = (
    _VARIATIONS.replace("robot.pose.yaw: {{uniform: [-1 deg, 1 deg]", "commands.twist.0.linear: {{uniform: [0.9, 1.0]")
    + "gate: {{passes: {{at_least: 90 %}}, runs: {samples}}}\n"
)

_HUSKY: Final = """\
name: husky drives
robot:
  model: husky/husky.urdf
  drive: {{diff: {{left: [front_left_wheel, rear_left_wheel], right: [front_right_wheel, rear_right_wheel]}}}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.89}}]}}
expect: [{{travel: {{at_least: {travel}}}}}]
time_limit: 30 s
duration: {duration}
backend: pybullet
"""

_OSC: Final = """\
import osc.helpers
import osc.pybullet

scenario husky_drives:
    timeout(600s)
    sim: simulation_pybullet
    husky: actor_pybullet
    do serial:
        sim.initialize("plane.urdf")
        husky.spawn("husky/husky.urdf", pose_3d(position: position_3d(z: 0.15)))
        parallel:
            sim.run()
            husky.set_joint_motor_control(5mps, 1)
            serial:
                {until}
                emit end
"""

# Its action connects with a window.
_WITHOUT_WINDOW: Final = """\
import pybullet
pybullet.GUI = pybullet.DIRECT
from scenario_execution.scenario_execution_base import main
main()
"""


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of a measurement.

    Attributes:
        folder: for scenarios and results.
        rounds: measured runs of each command; the medians count.
    """

    folder: Path
    rounds: int = 7
    variations: int = 1000
    engines: tuple[str, ...] = ENGINES


def one_test(settings: Settings) -> Iterator[object]:
    """One test that ends when the burger has driven 1.5 m, without and with report.html."""
    bounds = {"pybullet": (1.0, 1.1), "mujoco": (1.0, 1.05)}
    for engine in settings.engines:
        folder = _new(settings, f"one-{engine}")
        (folder / "one.sim.yml").write_text(_ONE.format(engine=engine))
        bare, reported, by_hand = take_turns(
            settings.rounds, ours(folder, "--no-report"), ours(folder), pytest_command(folder, engine, "test_one.py")
        )
        without, with_report = bounds[engine]
        name = f"{engine}: one test of 1.5 m"
        yield from compared(f"{name}, without report, against pytest", bare, by_hand, without)
        yield from compared(f"{name}, with report, against pytest", reported, by_hand, with_report)


def suite(settings: Settings) -> Iterator[object]:
    """32 scenarios of 4 s on two cores, with report.html."""
    for engine in settings.engines:
        folder = _new(settings, f"suite-{engine}")
        for number in range(SUITE):
            text = _SUITE.format(engine=engine, speed=(60 + number) / 100)
            (folder / f"{number:02}.sim.yml").write_text(text)
        mine, by_hand = take_turns(
            settings.rounds,
            ours(folder, "--jobs", "2", tests=2 * SUITE),
            pytest_command(folder, engine, "test_suite.py", "-p", "xdist", "-n", "2", tests=SUITE),
        )
        yield from compared(f"{engine}: {SUITE} scenarios of 4 s, against pytest-xdist -n 2", mine, by_hand, 1.0)


def variations(settings: Settings) -> Iterator[object]:
    """Many variations of 2 s, with report.html."""
    count = settings.variations
    for engine in settings.engines:
        folder = _new(settings, f"variations-{engine}")
        (folder / "drive.sim.yml").write_text(_VARIATIONS.format(engine=engine, samples=count))
        by_hand = pytest_command(folder, engine, "test_variations.py", tests=count, VARIATIONS=str(count))
        # A round takes a minute; all files have been read before, by the rounds of `one_test`.
        mine, theirs = take_turns(settings.rounds, ours(folder, tests=2 * count), by_hand, warm_up=False)
        yield from compared(f"{engine}: {count} variations of 2 s, against pytest", mine, theirs, 1.2)


def gate(settings: Settings) -> Iterator[object]:
    """A further run of a gate: the difference between a gate of 300 runs and one of 30, with report.html."""
    for engine in settings.engines:
        commands: list[Command] = []
        for runs in GATES:
            folder = _new(settings, f"gate-{engine}-{runs}")
            (folder / "drive.sim.yml").write_text(_GATE.format(engine=engine, samples=runs))
            commands.append(ours(folder))
            commands.append(pytest_command(folder, engine, "test_variations.py", tests=runs, VARIATIONS=str(runs)))
        few, few_by_hand, many, many_by_hand = take_turns(settings.rounds, *commands, warm_up=False)
        mine, theirs = many.cpu - few.cpu, many_by_hand.cpu - few_by_hand.cpu
        further = GATES[1] - GATES[0]
        yield Ratio(f"{engine}: a further run of 2 s of a gate, against pytest", mine / further, theirs / further, 1.2)


def steps(settings: Settings) -> Iterator[object]:
    """A step of the burger's drive of 30 s, against a loop by hand that keeps the full state."""
    bounds = {"pybullet": 1.05, "mujoco": 1.3}
    for engine in settings.engines:
        mine, raw = step_costs(engine, settings.rounds)
        yield Ratio(f"{engine}: a step of a run of 30 s, against a full sample by hand", mine, raw, bounds[engine])
        yield f"     {engine}: {mine * 1e6:.3g} us of CPU a step, by hand {raw * 1e6:.3g} us"


def husky(settings: Settings) -> Iterator[object]:
    """The husky of pybullet_data, against pytest and scenario_execution. Raises NotMeasuredError."""
    if "pybullet" not in settings.engines:
        return
    # Its waits are in real time, which a loaded machine does not keep up with. At 0.89 m/s, 25.7 m take 30 s.
    jobs = (
        ("1.5 m", "10 ms", "husky.distance_traveled(1.5m)", "test_husky_drives_1_5_m", 0.6),
        ("20 m", "30 s", "husky.distance_traveled(25.7m)", "test_husky_drives_30_s", 0.5),
    )
    data = importlib.util.find_spec("pybullet_data")
    if data is None or data.origin is None:
        raise NotMeasuredError("pybullet is not installed")
    missing = _missing_parts()
    for travel, duration, until, test, bound in jobs:
        name = f"pybullet: husky, {'30 s' if travel == '20 m' else travel}"
        folder = _new(settings, test)
        shutil.copytree(Path(data.origin).parent / "husky", folder / "husky")
        (folder / "husky.sim.yml").write_text(_HUSKY.format(travel=travel, duration=duration))
        (folder / "husky.osc").write_text(_OSC.format(until=until))
        commands = [ours(folder), pytest_command(folder, "pybullet", f"test_husky.py::{test}")]
        if missing is None:
            commands.append(scenario_execution(folder))
        mine, by_hand, *others = take_turns(settings.rounds, *commands)
        cpu = f"CPU {mine.cpu / by_hand.cpu:.2f} ({mine.cpu:.3g} s / {by_hand.cpu:.3g} s)"
        yield f"     {name}, against pytest, for orientation: {cpu}, wall time {mine.wall / by_hand.wall:.2f}"
        for theirs in others:
            # Its wall time is the sim time.
            yield Ratio(f"{name}, against scenario_execution", mine.cpu, theirs.cpu, bound)
    if missing is not None:
        raise NotMeasuredError(missing)


def ours(folder: Path, *options: str, tests: int = 1) -> Command:
    """`sim-action run` of all scenarios of a folder; each expectation is one of the tests."""
    program = str(Path(sys.executable).parent / "sim-action")
    return Command((program, "run", *options), folder, junit="sim-results/junit.xml", tests=tests)


def pytest_command(folder: Path, engine: str, test: str, *options: str, tests: int = 1, **environment: str) -> Command:
    """Return pytest's command for a hand-written test; it loads only the plugins that are named."""
    path = str(_FOLDER / f"with_{engine}" / test)
    arguments = (sys.executable, "-m", "pytest", "-q", "--junitxml=by-hand.xml", *options, path)
    alone = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", **environment}
    return Command(arguments, folder, junit="by-hand.xml", tests=tests, environment=alone)


def scenario_execution(folder: Path) -> Command:
    """scenario_execution of a husky's drive: one step for each tick, as in the example of its authors."""
    arguments = (_python(), "-c", _WITHOUT_WINDOW, "husky.osc", "-s", repr(1 / 240))
    return Command(arguments, folder)


def _python() -> str:
    return os.environ.get(PYTHON_VARIABLE) or sys.executable


def _missing_parts() -> str | None:
    """Return the reason why scenario_execution cannot be measured, with the remedy; None if it can."""
    program = "import scenario_execution, scenario_execution_pybullet"
    try:
        found = subprocess.run([_python(), "-c", program], check=False, capture_output=True, text=True)
    except OSError as error:
        return f"{PYTHON_VARIABLE}: {error}"
    if found.returncode == 0:
        return None
    return (
        "scenario_execution or its part for PyBullet is not installed. docs/workflow/by-hand.md has the steps; "
        f"name its Python in {PYTHON_VARIABLE}"
    )


def _new(settings: Settings, name: str) -> Path:
    folder = settings.folder / name
    folder.mkdir()
    return folder
