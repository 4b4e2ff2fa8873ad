"""Measure the cost of sim-action as ratios, side by side in one run: `make bench`.

Noise of the machine only ever adds time. All sides of a ratio take turns, and the least time of each one counts. Times
are printed for orientation only.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from tools.bench.by_hand import __main__ as by_hand
from tools.bench.by_hand.comparisons import Settings
from tools.bench.counting import counting_costs
from tools.bench.embedding import embedding_costs
from tools.bench.engines import PACKAGES, SideBySide, engines
from tools.bench.filming import filming_costs
from tools.bench.journal_cost import COUNT, journal_calls
from tools.bench.lidar import lidar_cost
from tools.bench.reading import reading_costs
from tools.bench.recording_cost import recording_cost
from tools.bench.reporting import MANY, opening_cost, report_cost
from tools.bench.ros1 import command as command_of_rostest
from tools.bench.ros1 import parts, ros
from tools.bench.script_cost import script_costs
from tools.bench.set_up import set_up_costs
from tools.bench.table import Measurement, NotMeasuredError, Ratio, print_table
from tools.bench.watching import watching_cost
from tools.bench.world_cost import BOXES, world_costs

ROOT = Path(__file__).resolve().parents[2]
RAW = ROOT / "tools/bench/raw_loop.py"
SUITE = 16
VARIATIONS = 200
BATCH = 10
ASKED = 1.4
"""The largest cost of watching, as a multiple of a hand-written loop."""

SCENARIO = """\
name: burger drives on {number}
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}]
duration: 30 s
time_limit: 30 s
"""


def command(*arguments: str, cwd: Path | None = None) -> Callable[[], object]:
    """A call of a program that lies beside this interpreter, to be timed."""
    program = Path(sys.executable).parent / arguments[0]
    environment = {**os.environ, "GITHUB_ACTIONS": ""}

    def call() -> object:
        return subprocess.run([program, *arguments[1:]], cwd=cwd, env=environment, check=True, capture_output=True)

    return call


def least_seconds(times: int, *calls: Callable[[], object]) -> list[float]:
    """The least wall time of each call; they take turns, after a first round that warms caches."""
    rounds = []
    for _ in range(times + 1):
        took = []
        for call in calls:
            started = time.perf_counter()
            call()
            took.append(time.perf_counter() - started)
        rounds.append(took)
    return [min(column) for column in zip(*rounds[1:], strict=True)]


def write_suite(folder: Path, count: int) -> Path:
    """A folder with `count` scenarios."""
    folder.mkdir()
    for number in range(count):
        (folder / f"{number}.sim.yml").write_text(SCENARIO.format(number=number))
    return folder


def whole_process(folder: Path) -> Ratio:
    """`sim-action run` of one scenario against a script that does the same by hand."""
    one = write_suite(folder / "one", 1)
    ours, theirs = least_seconds(8, command("sim-action", "run", str(one), cwd=folder), command("python", str(RAW)))
    return Ratio("whole process, against a raw script", ours, theirs, 1.6)


def further_scenario(folder: Path) -> Ratio:
    """Measure a scenario after all imports: read it, run it in its own child process, read its outcome back."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as the command line does
    from sim_action.core.process import Interruption
    from sim_action.reports.progress import ProgressListener
    from sim_action.runner.process_pool import Pool, PoolOptions
    from sim_action.runner.run_plan import Runs
    from sim_action.scenario.loading import load_scenario
    from tools.bench.raw_loop import drive

    path = write_suite(folder / "further", 1) / "0.sim.yml"
    listener = ProgressListener(total=1, verbosity="quiet")

    def ours() -> None:
        with Interruption() as interruption:
            (outcome,) = Pool(Runs([load_scenario(path)], folder), listener, interruption, PoolOptions(1)).outcomes()
        assert outcome.status == "passed"

    took, raw = least_seconds(20, ours, drive)
    return Ratio("each further scenario, against the raw loop", took, raw, 1.2)


def variations(folder: Path) -> Ratio:
    """Measure one of many variations of a scenario, with its share of the reading, against the raw loop."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as the command line does
    from sim_action.core.permissions import Permissions
    from sim_action.core.process import Interruption
    from sim_action.reports.progress import ProgressListener
    from sim_action.runner.process_pool import Pool, PoolOptions
    from sim_action.runner.run_plan import Runs
    from sim_action.scenario.files import read_file
    from sim_action.scenario.loading import load_all
    from sim_action.scenario.model import LoadedScenario
    from tools.bench.raw_loop import drive

    path = write_suite(folder / "variations", 1) / "0.sim.yml"
    drawn = f"robot.pose.yaw: {{uniform: [-1 deg, 1 deg], samples: {VARIATIONS}}}"
    path.write_text(path.read_text() + f"variations: {{{drawn}}}\n")
    listener = ProgressListener(total=VARIATIONS, verbosity="quiet")

    def loaded() -> list[LoadedScenario]:
        found = load_all(read_file(path, Permissions()), Permissions())
        return [run for run in found if isinstance(run, LoadedScenario)]

    runs = loaded()
    assert len(runs) == VARIATIONS
    batches = iter([runs[first : first + BATCH] for first in range(0, VARIATIONS, BATCH)])

    def ours() -> None:
        with Interruption() as interruption:
            outcomes = Pool(Runs(next(batches), folder), listener, interruption, PoolOptions(1)).outcomes()
        assert {outcome.status for outcome in outcomes} == {"passed"}

    def raw() -> None:
        for _ in range(BATCH):
            drive()

    (reading,) = least_seconds(3, loaded)
    took, by_hand = least_seconds(VARIATIONS // BATCH - 1, ours, raw)
    each = f"each of {VARIATIONS} variations, against the raw loop"
    return Ratio(each, took / BATCH + reading / VARIATIONS, by_hand / BATCH, 1.2)


def journal_cost(folder: Path) -> Ratio:
    """A suite that writes each outcome to the journal against one that does not."""
    ours, without = least_seconds(3, *journal_calls(folder / "journal"))
    return Ratio(f"{COUNT} short scenarios with a journal, against none", ours, without, 1.02)


def parallel(folder: Path) -> Ratio:
    """A suite with one job against the same with two."""
    suite = str(write_suite(folder / "suite", SUITE))
    one, two = least_seconds(3, *(command("sim-action", "run", "--jobs", jobs, suite, cwd=folder) for jobs in "12"))
    return Ratio(f"{SUITE} scenarios, one job against two", one, two, 1.6, at_most=False)


def cluster(folder: Path) -> Ratio:
    """Variations on two workers of Dask against two jobs, with the start of the workers."""
    scenario = folder / "cluster.sim.yml"
    varied = f"variations: {{world.ground.friction: {{uniform: [0.4, 1.2], samples: {VARIATIONS}}}}}\n"
    scenario.write_text(SCENARIO.format(number=0).replace("30 s", "4 s") + varied)
    ways = (("--cluster", "local:2"), ("--jobs", "2"))
    ours, jobs = least_seconds(2, *(command("sim-action", "run", *way, str(scenario), cwd=folder) for way in ways))
    return Ratio(f"{VARIATIONS} variations on two workers of Dask, against two jobs", ours, jobs, 1.3)


def proof(folder: Path) -> Ratio:
    """Measure `sim-action prove` of a scenario of 10 s with three expectations, against its own run."""
    scenario = folder / "proof.sim.yml"
    three = "expect: [{travel: {at_least: 1.5 m}}, no_collision, {upright: {max_tilt: 20 deg}}]"
    text = SCENARIO.format(number=0).replace("30 s", "10 s").replace("expect: [{travel: {at_least: 1.5 m}}]", three)
    scenario.write_text(text)
    ours, run = least_seconds(2, *(command("sim-action", name, str(scenario), cwd=folder) for name in ("prove", "run")))
    return Ratio("prove of three expectations, against the run of the scenario", ours, run, 15)


def start_up(folder: Path) -> Iterator[Ratio]:
    """Commands that need no engine against an interpreter that does nothing."""
    scenario = str(write_suite(folder / "start-up", 1))
    help_, validate, bare = least_seconds(
        20,
        command("sim-action", "--help"),
        command("sim-action", "validate", scenario),
        command("python", "-c", "pass"),
    )
    yield Ratio("--help, against python -c pass", help_, bare, 6)
    yield Ratio("validate of one file, against python -c pass", validate, bare, 20)


def models() -> Iterator[Ratio]:
    """Reading a model of 27 links against importing the engine, and a second time in a suite against the first."""
    rounds = [_model_cost() for _ in range(9)][1:]  # the first one fills the cache of meshes
    engine, first, second = map(min, zip(*rounds, strict=True))
    yield Ratio("reading a model of 27 links, against importing the engine", first, engine, 0.3)
    yield Ratio("the same model a second time in a suite, against the first", second, first, 0.05)


def _model_cost() -> tuple[float, ...]:
    command = [sys.executable, "-m", "tools.bench.model_cost"]
    ran = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return tuple(map(float, ran.stdout.splitlines()[-1].split()))


def scripts() -> Iterator[Ratio]:
    """A controller in Python that is asked at 50 Hz, against the same twists without one; the loop alone."""
    for cost in script_costs():
        yield Ratio(f"a script at 50 Hz, against twists, {cost.engine}", cost.by_script, cost.by_twists, 1.15)


def lidars() -> Iterator[Ratio]:
    """A lidar of 360 rays at 10 Hz: against loops by hand that cast the same rays, and unheard against none."""
    # A step of this robot is so cheap in MuJoCo that our loop is half as dear again before anything is sensed.
    for engine, whole, added in (("pybullet", 1.1, 1.1), ("mujoco", 2.0, 1.3)):
        heard, unheard, none, raw, raw_without = lidar_cost(engine)
        yield Ratio(f"{engine}: a run with a lidar, against a loop by hand", heard, raw, whole)
        rays = raw - raw_without
        yield Ratio(f"{engine}: the same, against our run without it and the rays by hand", heard, none + rays, added)
        yield Ratio(f"{engine}: a lidar that nobody listens to, against none", unheard, none, 1.05)


def worlds() -> Iterator[Ratio]:
    """A run in a map of 200 boxes, against the same beside a single box."""
    # In MuJoCo, a step beside one box takes a third of PyBullet's time; all pairs that may touch are looked at.
    most = {"pybullet": 1.6, "mujoco": 2.0}
    for cost in world_costs():
        name = f"{cost.engine}: a run in a map of {BOXES} boxes, against one box"
        yield Ratio(name, cost.mapped, cost.bare, most[cost.engine])
    yield Ratio("reading a map of 1,000 x 1,000 cells, against a run in it", cost.reading, cost.mapped, 4)


def watching() -> Iterator[Ratio]:
    """Contacts and clearance, watched at every step of a robot that goes round among things."""
    # 1.4 is what was asked for. In MuJoCo, a step of this robot takes a quarter of PyBullet's time: its loop is a sixth
    # dearer than one by hand before anything is watched, and what Python adds to watch it weighs four times as much.
    for engine, unwatched, watched in (("pybullet", 1.2, 1.4), ("mujoco", 1.4, 2.0)):
        cost = watching_cost(engine)
        asked = "" if watched <= ASKED else f" ({ASKED} asked for, out of reach where a step is so cheap)"
        name = f"{engine}: contacts and clearance watched at every step, against a loop by hand{asked}"
        yield Ratio(
            f"{engine}: the same run, unwatched, against a loop by hand", cost.unwatched, cost.by_hand, unwatched
        )
        yield Ratio(name, cost.watching, cost.by_hand, watched)


def counting() -> Iterator[Ratio]:
    """A run with seven expectations, against the same without the time in which their moments are counted."""
    for cost in counting_costs():
        name = f"{cost.engine}: a run with seven expectations, against the same without counting moments"
        yield Ratio(name, cost.whole, cost.bare, 1.02)


def filming() -> Iterator[Ratio]:
    """Measure the cost of a replay for a run of 30 s, against the same run on PyBullet without it."""
    for cost in filming_costs():
        name = f"{cost.engine}: what a replay ({cost.size / 1000:.1f} kB) adds to the burger {cost.world}"
        yield Ratio(f"{name}, against PyBullet's run", cost.added, cost.run, 0.25)


def reporting() -> Iterator[Ratio]:
    """The cost of writing report.html, and its size."""
    one, many = report_cost(1, 30), report_cost(MANY, 10)
    yield Ratio("report.html of a run of 30 s, against the run", one.written, one.runs, 0.25)
    yield Ratio(f"report.html of {MANY} runs of 10 s, against the runs", many.written, many.runs, 0.25)
    size, all_sizes = one.size / 1e6, many.size / 1e6
    yield Ratio("report.html of a run of 30 s, against what it may weigh", size, 0.46, 1, unit="kB")
    further = (all_sizes - size) / (MANY - 1)
    yield Ratio("what a further run of 10 s adds, against what it may", further, 0.025, 1, unit="kB")


def opening() -> Iterator[Ratio]:
    """The time until a headless browser shows a report. Raises NotMeasuredError."""
    yield Ratio(f"report.html of {MANY} runs in a headless browser, against 1 s", opening_cost(), 1, 1)


def recordings() -> Iterator[Ratio]:
    """Measure --record csv and --record mcap with the data kept for them, against a loop without; 30 s, 30 Hz."""
    # MuJoCo takes a fifth of the time for the same run, and what is kept of it is as much.
    for engine, csv in (("pybullet", 0.25), ("mujoco", 0.5)):
        cost = recording_cost(engine)
        yield Ratio(f"{engine}: --record csv, against the loop", cost.keeping + cost.csv, cost.loop, csv)
        yield Ratio(f"{engine}: --record mcap, against the loop", cost.keeping + cost.mcap, cost.loop, 0.75)
        print(f"     {engine}: a picture of a film, for orientation: {cost.picture * 1000:.3g} ms")


def rostest() -> Iterator[Ratio]:
    """A package of ROS 1 on real ROS. Raises NotMeasuredError where ROS 1 is not installed."""
    if (installed := ros()) is None:
        raise NotMeasuredError("ROS 1 is not installed")
    split = parts(installed)
    print(split)
    yield Ratio("sim time of a rostest, against its wall time", split.sim_time, split.sim, 4, at_most=False)
    yield Ratio("sim-action rostest, against 6 s", command_of_rostest(), 6, 1)


def side_by_side(folder: Path) -> Iterator[SideBySide | str]:
    """Both engines, for orientation: no bound."""
    yield "\nboth engines, for orientation:"
    suite = str(write_suite(folder / "both", 1))
    yield from engines(
        {engine: command("sim-action", "run", "--backend", engine, suite, cwd=folder) for engine in PACKAGES}
    )


def measurements(folder: Path) -> Sequence[Measurement]:
    """All measurements in the order of the table."""
    return [
        Measurement("start-up", partial(start_up, folder)),
        Measurement("models", models),
        Measurement("reading", partial(reading_costs, folder)),
        Measurement("whole process", lambda: [whole_process(folder)]),
        Measurement("each further scenario", lambda: [further_scenario(folder)]),
        Measurement("variations", lambda: [variations(folder)]),
        Measurement("journal", lambda: [journal_cost(folder)]),
        Measurement("two jobs", lambda: [parallel(folder)]),
        Measurement("a proof", lambda: [proof(folder)]),
        Measurement("a cluster", lambda: [cluster(folder)]),
        Measurement("a program", partial(embedding_costs, folder / "program")),
        # A quarter of an hour.
        *by_hand.measurements(Settings(folder)),
        Measurement("scripts", scripts),
        Measurement("lidars", lidars),
        Measurement("worlds", worlds),
        Measurement("watching", watching),
        Measurement("counted moments", counting),
        Measurement("replays", filming),
        Measurement("recordings", recordings),
        Measurement("reports", reporting),
        Measurement("a report in a browser", opening),
        Measurement("rostest", rostest),
        # It downloads all packages several times.
        Measurement("set-up of the action (two minutes)", partial(set_up_costs, folder)),
        Measurement("both engines, for orientation", partial(side_by_side, folder)),
    ]


def main() -> None:
    """Print one line for each ratio; exit with 1 if a bound is missed or a measurement fails."""
    # A shell that forbids bytecode would have each call compile this package, but not the raw script.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory() as name:
        kept = print_table(measurements(Path(name)))
    sys.exit(not kept)


if __name__ == "__main__":
    main()
