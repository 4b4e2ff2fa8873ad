"""The plan of a proof: which scenarios are proven, which mutants of each run, and what that costs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean, escaped_line, shown
from sim_action.drives import recognise
from sim_action.runner.mutation import world_faults
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.run_plan import Plan
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.scenario.mutation import Mutation, SensorFault
from sim_action.scenario.source import Refused
from sim_action.sensors import MountedSensor, Sensor
from sim_action.simulation.mutations import DRIFT_S, STALE_S, partners
from sim_action.state.readings import biased_columns


@dataclass(frozen=True, slots=True)
class PlannedMutants:
    """The mutants of a run."""

    original: Original  # the run that passed
    every: Sequence[Mutant]  # all its mutants, in the order of the table
    chosen: Sequence[Mutant]  # the mutants to run, in the same order

    @property
    def left_out(self) -> int:
        """The number of mutants that do not run: the call named others, or they do not fit into the budget."""
        return len(self.every) - len(self.chosen)


def first_runs(plans: Iterable[Plan]) -> Iterator[LoadedScenario | Refused]:
    """Yield one run of each scenario: its first variation, on the first of its engines."""
    seen = set[tuple[object, str]]()
    for plan in plans:
        if isinstance(plan, Refused):
            yield plan
            continue
        source = plan[0].source
        if source.group is not None:
            if (key := (source.path, source.group)) in seen:
                continue
            seen.add(key)
        # Its motion is not compared with the motion in another engine.
        yield replace(plan[0], compared=False)


def refuse_unknown(names: Iterable[str]) -> None:
    """Raise UsageError for a name that no mutant can have; a name is a kind, or a kind and a subject."""
    for name in names:
        kind = name.partition(":")[0]
        if kind not in KINDS:
            raise UsageError(f"--only: there is no mutant {shown(name)}{did_you_mean(kind, KINDS)}")


def refuse_unmatched(plans: Sequence[PlannedMutants], names: Iterable[str]) -> None:
    """Raise UsageError for a name of a single mutant that no run has; without any run, nothing is known."""
    every = {strength.name for plan in plans for mutant in plan.every for strength in mutant.strengths}
    for name in names:
        kind, colon, _ = name.partition(":")
        if plans and colon and name not in every:
            hint = did_you_mean(name, (candidate for candidate in every if candidate.partition(":")[0] == kind))
            raise UsageError(escaped_line(f"--only: no scenario that passes has the mutant {shown(name)}{hint}"))


def planned(originals: Iterable[Original], only: Collection[str] = ()) -> list[PlannedMutants]:
    """Return the mutants of each run, all of them if `only` is empty; see `refuse_unknown`."""
    pairs = ((original, [mutant for row in TABLE for mutant in row.mutants(original)]) for original in originals)
    return [
        PlannedMutants(original, every, [some for mutant in every for some in _chosen(mutant, only)])
        for original, every in pairs
    ]


def _chosen(mutant: Mutant, only: Collection[str]) -> Iterator[Mutant]:
    """Yield a mutant with all its strengths, or each of its named strengths alone."""
    if not only or mutant.kind in only:
        yield mutant
    else:
        named = (strength for strength in mutant.strengths if strength.name in only)
        yield from (replace(strength, milder=(), stronger=()) for strength in named)


def cost(plans: Iterable[PlannedMutants], jobs: int) -> float:
    """Return the estimated wall time in s of all mutants, from the originals: a mutant may run up to its time limit."""
    return sum(plan.original.outcome.wall_time * len(plan.chosen) for plan in plans) / jobs


def within(plans: Sequence[PlannedMutants], seconds: float, jobs: int) -> list[PlannedMutants]:
    """Return the plans with the most telling mutants in a wall time in s, by turns of kinds and scenarios."""
    left = seconds * jobs
    chosen: list[set[str]] = [set() for _ in plans]
    for _, place, mutant in sorted(_ranked(plans), key=lambda ranked: ranked[:2]):
        needed = plans[place].original.outcome.wall_time
        if needed <= left:
            left -= needed
            chosen[place].add(mutant.name)
    return [
        replace(plan, chosen=[mutant for mutant in plan.chosen if mutant.name in names])
        for plan, names in zip(plans, chosen, strict=True)
    ]


def _ranked(plans: Sequence[PlannedMutants]) -> Iterator[tuple[tuple[int, int], int, Mutant]]:
    """Yield each mutant after its rank and the index of its plan."""
    for place, plan in enumerate(plans):
        before = Counter[str]()
        for mutant in plan.chosen:
            yield (before[mutant.kind], KINDS.index(mutant.kind)), place, mutant
            before[mutant.kind] += 1


DELAYS_S: Final = (0.5, 0.25, 0.1)
SLOWER: Final = 0.5
FASTER: Final = (2.0, 10.0, 57.3)
HEAVIER: Final = (2.0, 5.0)
NOISIER: Final = 10.0

NOISES: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {"lidar": {"noise": 0.05}, "odometry": {"noise": 0.05}, "imu": {"gyro_noise": 0.05, "accelerometer_noise": 0.5}}
)
"""The noise that a sensor without any gets, in the unit of each key."""

MOST_MOTORS: Final = 4
"""The number of motors that have a mutant: first by the motion of their joints, then by their effort."""

# In rad and N m, or m and N if prismatic: a joint that moved less and bore less has no mutant.
_LEAST_MOTION: Final = 0.01
_LEAST_EFFORT: Final = 0.1


@dataclass(frozen=True, slots=True)
class Row:
    """A kind of mutant."""

    kind: str  # its name
    words: str  # what it changes
    mutants: Callable[[Original], Iterable[Mutant]]  # yields its mutants of a run; nothing if it does not apply


def _silenced(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("silenced", "", "no command reaches the robot", Mutation(silent=True))


def _swapped(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("swapped", "", "left and right are swapped in commands", Mutation(mirrored=True))


def _scaled(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        slower, *faster = (
            original.mutant(
                "scaled", f"x{speed:g}", f"all commands have {speed:g} times their speed", Mutation(speed=speed)
            )
            for speed in (SLOWER, *FASTER)
        )
        yield slower
        yield replace(faster[0], stronger=tuple(faster[1:]))


def _reversed(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        words = "the {} part of commands has the other sign"
        yield original.mutant("reversed", "linear", words.format("linear"), Mutation(reversed="linear"))
        yield original.mutant("reversed", "angular", words.format("angular"), Mutation(reversed="angular"))
        for joint in busy_joints(original)[:1]:
            words = f"the motor of joint '{joint}' turns the other way"
            yield original.mutant("reversed", joint, words, Mutation(reversed_joint=joint))


def _swapped_wheels(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands and partners(_wheels(original)):
        words = "left and right wheels are swapped behind the drive"
        yield original.mutant("swapped-wheels", "", words, Mutation(crossed_wheels=True))


def _delayed(original: Original) -> Iterator[Mutant]:
    scenario = original.scenario
    if scenario.commands:
        first, *milder = (
            original.changed(
                "delayed", f"{delay:g}s", f"all commands arrive {delay:g} s later", _with_latency(scenario, delay)
            )
            for delay in DELAYS_S
        )
        yield replace(first, milder=tuple(milder))


def _with_latency(scenario: Scenario, delay: float) -> Scenario:
    late = tuple(source.model_copy(update={"latency": source.latency + delay}) for source in scenario.commands)
    return scenario.model_copy(update={"commands": late})


def _motors_off(original: Original) -> Iterator[Mutant]:
    for joint in busy_joints(original)[:MOST_MOTORS]:
        words = f"the motor of joint '{joint}' is off"
        yield original.mutant("motor-off", joint, words, Mutation(dead_joint=joint))


def busy_joints(original: Original) -> list[str]:
    """Return the joints whose motors have work to do: first wheels of the drive, then joints that move, then others."""
    loaded, trace = original.loaded, original.trace
    ways = np.abs(np.diff(trace.joint_position, axis=0)).sum(axis=0).tolist()
    efforts = np.abs(trace.joint_effort).max(axis=0, initial=0.0).tolist()
    busy = {
        name: (way if way > _LEAST_MOTION else 0.0, effort)
        for name, way, effort in zip(trace.joint_names, ways, efforts, strict=True)
        if way > _LEAST_MOTION or effort > _LEAST_EFFORT
    }
    wheels = _wheels(original)
    if loaded.model is not None:
        busy = {name: work for name, work in busy.items() if loaded.model.why_not_driven(name) is None}
    # Equal joints move equally far but for rounding.
    return sorted(busy, key=lambda name: (name not in wheels, *(-round(work, 1) for work in busy[name])))


def _wheels(original: Original) -> frozenset[str]:
    loaded = original.loaded
    drive = loaded.scenario.robot.drive or (recognise(loaded.model) if loaded.model else None)
    return drive.open(loaded.model, loaded.scenario.physics.rate).joints if drive and loaded.model else frozenset()


def _heavier(original: Original) -> Iterator[Mutant]:
    if not original.scenario.robot.is_mjcf:
        first, *others = (
            original.mutant("heavier", f"x{mass:g}", f"the robot has {mass:g} times its mass", Mutation(mass=mass))
            for mass in HEAVIER
        )
        yield replace(first, stronger=tuple(others))


def _faulty(reading: SensorFault, words: str) -> Callable[[Original], Iterator[Mutant]]:
    """Return the function that yields a mutant for each sensor with a fault; `words` follow the name of the sensor."""

    def mutants(original: Original) -> Iterator[Mutant]:
        for mounted in read_sensors(original):
            if reading in ("frozen", "stale") or biased_columns(mounted.sensor.key):
                fault = Mutation(sensor=mounted.name, reading=reading)
                yield original.mutant(reading, mounted.name, f"the sensor '{mounted.name}' {words}", fault)

    return mutants


def _noisy(original: Original) -> Iterator[Mutant]:
    for mounted in read_sensors(original):
        noise, is_stated = noise_of(mounted.sensor)
        if noise:
            more = {key: NOISIER * value if is_stated else value for key, value in noise.items()}
            noisy = replace(mounted, sensor=mounted.sensor.model_copy(update=more))
            words = f"the sensor '{mounted.name}' has {NOISIER:g} times its noise"
            yield _with_sensors(original, "noisy", mounted, words, noisy)


def noise_of(sensor: Sensor) -> tuple[dict[str, float], bool]:
    """Return the keys of a sensor's noise with their values, and True; without noise, keys that it gets, and False."""
    keys = NOISES.get(sensor.key, {key: 0.0 for key in type(sensor).model_fields if key.endswith("noise")})
    stated = {key: value for key in keys if isinstance(value := getattr(sensor, key), float) and value}
    return stated or {key: value for key, value in keys.items() if value}, bool(stated)


def _dropped(original: Original) -> Iterator[Mutant]:
    sources = {
        key for source in original.scenario.commands for key in ("ros1", "ros2") if key in type(source).model_fields
    }
    if sources:
        judged = {name for expected in original.scenario.expect for name in expected.channels.sensors}
        for mounted in original.scenario.sensors:
            if mounted.name not in judged:
                words = f"nodes get nothing from the sensor '{mounted.name}'"
                yield _with_sensors(original, "dropped", mounted, words)


def _with_sensors(original: Original, kind: str, mounted: MountedSensor, words: str, *instead: MountedSensor) -> Mutant:
    several = ((instead if sensor is mounted else (sensor,)) for sensor in original.scenario.sensors)
    sensors = tuple(sensor for some in several for sensor in some)
    return original.changed(kind, mounted.name, words, original.scenario.model_copy(update={"sensors": sensors}))


def read_sensors(original: Original) -> list[MountedSensor]:
    """Return the sensors that a controller or an expectation may read."""
    scenario = original.scenario
    if any(not source.is_written for source in scenario.commands):
        return list(scenario.sensors)
    judged = {name for expected in scenario.expect for name in expected.channels.sensors}
    return [mounted for mounted in scenario.sensors if mounted.name in judged]


TABLE: Final = (
    Row("silenced", "no command reaches the robot", _silenced),
    Row("swapped", "left and right are swapped in all commands", _swapped),
    Row(
        "wall", "a wall stands across the way that the robot drove, or a box in the way of an arm", world_faults.walled
    ),
    Row(
        "reversed",
        "commands have the other sign: their linear part, their angular part, or the joint with the most work",
        _reversed,
    ),
    Row(
        "turned",
        f"the robot begins with a heading that is {world_faults.TURN_DEG:g} deg further left",
        world_faults.turned,
    ),
    Row(
        "scaled",
        f"commanded speeds, efforts and forces, and the way of joints from their start, are multiplied by {SLOWER:g} "
        f"and by {FASTER[0]:g}; by {FASTER[1]:g} and {FASTER[2]:g} (degrees for radians) where less is not noticed",
        _scaled,
    ),
    Row("swapped-wheels", "left and right wheels are swapped behind the drive", _swapped_wheels),
    Row(
        "motor-off",
        f"the motor of one joint is off; for the {MOST_MOTORS} joints that moved most, or bore most",
        _motors_off,
    ),
    Row(
        "removed",
        f"one object or other robot is missing, for the {world_faults.MOST_OBJECTS} nearest; a robot that the scenario "
        "names gets no commands",
        world_faults.removed,
    ),
    Row("frozen", "one sensor repeats its first reading", _faulty("frozen", "repeats its first reading")),
    Row(
        "stale",
        f"the readings of one sensor are old by {STALE_S:g} s",
        _faulty("stale", f"gives readings that are old by {STALE_S:g} s"),
    ),
    Row(
        "biased",
        "one sensor adds a constant error: 0.2 m, 0.2 m/s, 0.2 rad/s, 1 m/s^2, 10 N",
        _faulty("biased", "adds a constant error to its readings"),
    ),
    Row(
        "drifting",
        f"one sensor adds an error that grows, and is that of `biased` after {DRIFT_S:g} s",
        _faulty("drifting", "adds an error that grows with time"),
    ),
    Row("dropped", "ROS nodes get nothing from one sensor", _dropped),
    Row(
        "slippery",
        f"the friction of the ground is divided by 4; {world_faults.ICE:g}, as on ice, where that is not noticed",
        world_faults.slippery,
    ),
    Row("calm", "no disturbance, patch, noise, jitter or dropout acts, if there is any", world_faults.calm),
    Row("uneventful", "one event never happens", world_faults.uneventful),
    Row(
        "shoved",
        f"a push against the upper edge of the robot, halfway through the run: in {world_faults.SHOVE_S:g} s it exerts "
        f"the momentum of the robot's mass at {world_faults.SHOVE_M_S:g} m/s, to the left",
        world_faults.shoved,
    ),
    Row(
        "moved",
        "one object stands nearer to the way, or farther from an arm that comes to it, by its own size at most; "
        f"for the {world_faults.MOST_OBJECTS} nearest",
        world_faults.moved,
    ),
    Row("delayed", f"all commands arrive {DELAYS_S[0]:g} s later, or less: the least that is noticed", _delayed),
    Row("heavier", "the robot has twice its mass; 5 times where that is not noticed", _heavier),
    Row("noisy", f"one sensor has {NOISIER:g} times its noise, or some if it has none", _noisy),
)
"""All kinds of mutants, the most telling first."""

KINDS: Final = tuple(row.kind for row in TABLE)
