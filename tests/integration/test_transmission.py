"""Late and lost commands and readings on real engines, against what formulas say of them."""

from __future__ import annotations

import math
import zlib
from pathlib import Path

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import inertia
from tests.simulated import simulated

INERTIAL = f'<inertial><mass value="1"/>{inertia(1)}</inertial>'
SLIDER = f"""\
<robot name="slider">
  <link name="rail">{INERTIAL}</link>
  <link name="cart">{INERTIAL}</link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-100" upper="100" effort="1000000" velocity="1000"/></joint>
</robot>
"""
ON_RAILS = """\
name: cart
robot: {model: slider.urdf, base: fixed, pose: {z: 1}}
trace: {rate: 240 Hz}
expect: [{joint_within: {position: {slide: [-90 m, 90 m]}}}]
"""


def commanding(speed: str) -> str:
    return (
        "from sim_action import JointTargets\n\ndef control(seen):\n"
        f'    return JointTargets(velocity={{"slide": {speed}}})\n'
    )


AHEAD = commanding("1.0 if seen.time >= 0.25 else 0.0")


def run(folder: Path, engine: str, text: str, script: str = "") -> SimulationRun:
    (folder / "slider.urdf").write_text(SLIDER)
    (folder / "ctl.py").write_text(script)
    return simulated(folder, f"{text}backend: {engine}\n")


def cart(folder: Path, engine: str, script: str, keys: str, *, end: float = 1.0) -> np.ndarray:
    """Return the position of the cart at every step."""
    commands = f"commands: {{script: ctl.py, rate: 20{keys}}}\ntime_limit: {end} s\n"
    trace = run(folder, engine, ON_RAILS + commands, script).trace
    return trace.joint_position[:, 0]


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize(("latency", "steps"), [("100 ms", 24), ("0.101 s", 25), ("30 ms", 8)])
def test_a_step_comes_later_by_exactly_its_latency(engine: str, latency: str, steps: int, tmp_path: Path) -> None:
    at_once, late = cart(tmp_path, engine, AHEAD, ""), cart(tmp_path, engine, AHEAD, f", latency: {latency}")
    assert at_once[70] > 0.01
    assert np.abs(late[steps:] - at_once[:-steps]).max() < 1e-12
    # The first moment at which it moves, to the step.
    first, later = (int(np.argmax(np.abs(way) > 1e-6)) for way in (at_once, late))
    assert later - first == steps


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize(("periods", "end"), [(1, 4), (4, 12)])
def test_a_late_controller_swings_beyond_the_gain_that_theory_gives(
    engine: str, periods: int, end: int, tmp_path: Path
) -> None:
    # x[n + 1] = x[n] - k T x[n - d] is stable for k T < 2 sin(pi / (2 (2 d + 1))).
    rate = 20
    limit = 2 * rate * math.sin(math.pi / (2 * (2 * periods + 1)))

    def growth(gain: float) -> float:
        # Its velocity is -gain times its position: an integrator under a P controller.
        script = commanding(f'2.0 if seen.time < 0.05 else -{gain!r} * seen.joints["slide"].position')
        way = cart(tmp_path, engine, script, f", latency: {periods / rate}", end=end)
        _, second, _, last = np.split(np.abs(way[: 240 * end]), 4)
        return float(last.max() / second.max())

    assert growth(0.93 * limit) < 0.8
    assert growth(1.07 * limit) > 1.25


SENSORS = """\
name: burger
seed: SEED
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 2, 0.5], pose: {x: 1}}]}
sensors:
  - {imu: {}, rate: 20 Hz, trace: true, KEYS}
  - {lidar: {rays: 5}, rate: 20 Hz, trace: true, KEYS}
  - {contact: {}, link: wheel_left_link, rate: 20 Hz, trace: true, KEYS}
  - {odometry: {}, rate: 20 Hz, trace: true, KEYS}
  - {camera: {width: 4, height: 3}, rate: 20 Hz, trace: true, KEYS}
commands: {script: ctl.py, rate: 240 Hz}
expect: [upright, {sensor: {name: imu, reading: linear_acceleration_xyz, which: z, at_least: 5}}]
time_limit: 1 s
"""
# A controller that writes down what it sees: at which time it has which reading.
WRITING = """\
from pathlib import Path
from sim_action import Twist

LOG = open(Path(__file__).with_name("seen.txt"), "w")

def control(seen):
    print(seen.time, *(seen.sensors[name].time for name in ("imu", "lidar", "contact", "odometry", "camera")),
          file=LOG, flush=True)
    return Twist.planar(0.2)
"""


def seen(folder: Path, engine: str, keys: str, seed: int = 0) -> tuple[np.ndarray, SimulationRun]:
    """Return rows of the time and the stamps of five readings, and the run."""
    found = run(folder, engine, SENSORS.replace("KEYS", keys).replace("SEED", str(seed)), WRITING)
    return np.loadtxt(folder / "seen.txt"), found


@pytest.mark.parametrize("engine", installed())
def test_every_sensor_delivers_each_reading_later_with_its_own_time(engine: str, tmp_path: Path) -> None:
    rows, late = seen(tmp_path, engine, "latency: 70 ms")  # 17 steps
    steps, stamps = np.rint(240 * rows[:, 0]).astype(int), rows[:, 1:]
    # The reading of t = 0 is there from the start.
    expected = np.maximum(0, (steps - 17) // 12) * 12 / 240
    assert np.abs(stamps - expected[:, None]).max() < 1e-9
    _, at_once = seen(tmp_path, engine, "latency: 0 s")
    # The robot drives alike, and readings are recorded when they were taken.
    assert late.digest == at_once.digest
    for name, record in at_once.trace.sensors.items():
        assert late.trace.sensors[name].time.tolist() == record.time.tolist()
    assert [verdict.status for verdict in late.verdicts] == ["passed", "passed"]


@pytest.mark.parametrize("engine", installed())
def test_lost_readings_reach_neither_controllers_nor_the_trace(engine: str, tmp_path: Path) -> None:
    rows, lossy = seen(tmp_path, engine, "dropouts: 30 %", seed=3)
    for column, name in enumerate(("imu", "lidar", "contact", "odometry", "camera"), start=1):
        recorded = lossy.trace.sensors[name].time
        assert sorted(set(rows[:, column])) == [time for time in recorded.tolist() if time <= rows[-1, 0]]
        # 19 are sent after t = 0. More than 14 losses have P < 0.0001, and none has P = 0.001.
        assert 5 < len(recorded) < 20
        assert f"{20 - len(recorded)} of 19 readings of sensor '{name}' were lost" in lossy.notes
    # Each sensor has a stream of its own.
    assert len({tuple(record.time.tolist()) for record in lossy.trace.sensors.values()}) == 5
    again, other = (seen(tmp_path, engine, "dropouts: 30 %", seed=seed)[0] for seed in (3, 4))
    assert (again == rows).all()
    assert (other != rows).any()


@pytest.mark.parametrize("engine", installed())
def test_lost_commands_leave_the_last_one_in_effect(engine: str, tmp_path: Path) -> None:
    # Each command turns the wheel by its own speed, so the trace shows which ones came.
    way = cart(tmp_path, engine, commanding("round(seen.time * 20) / 20"), ", dropouts: 0.5")
    speeds = np.rint(np.diff(way)[6::12] * 240 * 20).astype(int)
    held = np.maximum.accumulate(speeds)
    assert (speeds == held).all()
    lost = int((np.diff(speeds) == 0).sum())
    assert 2 <= lost <= 18
    before = [0, *speeds[:-1]]
    assert all(speed in (number, earlier) for number, (speed, earlier) in enumerate(zip(speeds, before, strict=True)))


@pytest.mark.parametrize("engine", installed())
def test_jittered_commands_take_effect_at_the_steps_of_their_draws(engine: str, tmp_path: Path) -> None:
    # The speed of each command is other than that of the one before, so the trace shows when it came.
    script = commanding("0.1 + round(seen.time * 20) % 2")
    way = cart(tmp_path, engine, script, ", latency: 20 ms, jitter: 200 ms", end=2.0)
    random = np.random.default_rng((0, zlib.crc32(b"transmission of commands[0]")))
    delays = [math.ceil((0.02 + 0.2 * share) * 240 - 1e-6) for _, share in random.random((40, 2)).tolist()]
    arrivals = np.maximum.accumulate([12 * tick + delay for tick, delay in enumerate(delays)])
    # Some are held up by an earlier one: order is kept.
    assert (arrivals != [12 * tick + delay for tick, delay in enumerate(delays)]).any()
    latest = np.searchsorted(arrivals, np.arange(480), side="right") - 1
    expected = np.where(latest < 0, 0.0, 0.1 + latest % 2)
    # Engines may need a step to come to a speed.
    steady = np.diff(expected, prepend=0.0) == 0
    assert np.abs(240 * np.diff(way) - expected)[steady].max() < 1e-3
    assert steady.sum() > 400


def test_a_changed_command_is_the_one_that_was_given(tmp_path: Path) -> None:
    script = """\
from sim_action import JointTargets

SPEEDS = {"slide": 0.0}

def control(seen):
    SPEEDS["slide"] = 1.0 if seen.time >= 0.25 else 0.0
    return JointTargets(velocity=SPEEDS)
"""
    engine = installed()[0]
    given, fresh = (cart(tmp_path, engine, text, ", latency: 0.1 s") for text in (script, AHEAD))
    assert (given == fresh).all()


def test_the_end_of_a_lossy_trajectory_is_repeated_until_it_arrives(tmp_path: Path) -> None:
    text = ON_RAILS + "commands: {joints: [{at: 0.5 s, position: {slide: 1}}], dropouts: 80 %}\ntime_limit: 2 s\n"
    trace = run(tmp_path, installed()[0], text).trace
    assert trace.joint_position[-1, 0] == pytest.approx(1.0, abs=1e-4)
    assert abs(trace.joint_velocity[-1, 0]) < 1e-4


@pytest.mark.parametrize("engine", installed())
def test_the_example_stops_too_late_if_its_controller_takes_late_scans_for_the_present(
    engine: str, tmp_path: Path
) -> None:
    folder = Path(__file__).parents[2] / "examples/sensors"
    text, script = ((folder / f"latency.{kind}").read_text() for kind in ("sim.yml", "py"))
    (tmp_path / "latency.py").write_text(script.replace(" - since", ""))
    stopped, _ = run(tmp_path, engine, text).verdicts
    assert not stopped.passed
    assert "0.13" in stopped.message
