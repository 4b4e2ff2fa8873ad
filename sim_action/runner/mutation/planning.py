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
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.mutation import Mutation
from sim_action.scenario.source import Refused
from sim_action.sensors import MountedSensor


@dataclass(frozen=True, slots=True)
class PlannedMutants:
    """The mutants of a run.

    Attributes:
        original: the run that passed.
        every: all its mutants, in the order of the table.
        chosen: the mutants to run, in the same order.
    """

    original: Original
    every: Sequence[Mutant]
    chosen: Sequence[Mutant]

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
        # Its motion is not compared with that of another engine.
        yield replace(plan[0], compared=False)


def refuse_unknown(names: Iterable[str]) -> None:
    """Raise UsageError for a name that no mutant can have; a name is a kind, or a kind and a subject."""
    for name in names:
        kind = name.partition(":")[0]
        if kind not in KINDS:
            raise UsageError(f"--only: there is no mutant {shown(name)}{did_you_mean(kind, KINDS)}")


def refuse_unmatched(plans: Sequence[PlannedMutants], names: Iterable[str]) -> None:
    """Raise UsageError for a name of a single mutant that no run has; without any run, nothing is known."""
    every = {mutant.name for plan in plans for mutant in plan.every}
    for name in names:
        kind, colon, _ = name.partition(":")
        if plans and colon and name not in every:
            hint = did_you_mean(name, (each for each in every if each.partition(":")[0] == kind))
            raise UsageError(escaped_line(f"--only: no scenario that passes has the mutant {shown(name)}{hint}"))


def planned(originals: Iterable[Original], only: Collection[str] = ()) -> list[PlannedMutants]:
    """Return the mutants of each run, all of them if `only` is empty; see `refuse_unknown`."""
    return [_planned(original, only) for original in originals]


def _planned(original: Original, only: Collection[str]) -> PlannedMutants:
    every = [mutant for row in TABLE for mutant in row.mutants(original)]
    chosen = [mutant for mutant in every if not only or mutant.kind in only or mutant.name in only]
    return PlannedMutants(original, every, chosen)


def cost(plans: Iterable[PlannedMutants], jobs: int) -> float:
    """Return the estimated wall time in s of all mutants, from the originals: a mutant may run up to its time limit."""
    return sum(each.original.outcome.wall_time * len(each.chosen) for each in plans) / jobs


def within(plans: Sequence[PlannedMutants], seconds: float, jobs: int) -> list[PlannedMutants]:
    """Return the plans with the most telling mutants that take at most a wall time in s.

    The first mutant of each kind comes before the second one of any kind, and scenarios take turns.
    """
    left = seconds * jobs
    chosen: list[set[str]] = [set() for _ in plans]
    for _, place, mutant in sorted(_ranked(plans), key=lambda each: each[:2]):
        needed = plans[place].original.outcome.wall_time
        if needed <= left:
            left -= needed
            chosen[place].add(mutant.name)
    return [
        replace(each, chosen=[mutant for mutant in each.chosen if mutant.name in names])
        for each, names in zip(plans, chosen, strict=True)
    ]


def _ranked(plans: Sequence[PlannedMutants]) -> Iterator[tuple[tuple[int, int], int, Mutant]]:
    """Yield each mutant after its rank and the index of its plan."""
    for place, each in enumerate(plans):
        before = Counter[str]()
        for mutant in each.chosen:
            yield (before[mutant.kind], KINDS.index(mutant.kind)), place, mutant
            before[mutant.kind] += 1


DELAY_S: Final = 0.5
SLOWER: Final = 0.5
FASTER: Final = 2.0
HEAVIER: Final = 2.0
NOISIER: Final = 10.0

NOISES: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "lidar": {"noise": 0.05},
        "odometry": {"noise": 0.05},
        "imu": {"gyro_noise": 0.05, "accelerometer_noise": 0.5},
    }
)
"""The noise that a sensor without any gets, in the unit of each key."""

MOST_MOTORS: Final = 4
"""The number of motors that have a mutant: those whose joints moved most, then those that bore most."""

# In rad and N m, or m and N if prismatic: a joint that moved less and bore less has no mutant.
_LEAST_MOTION: Final = 0.01
_LEAST_EFFORT: Final = 0.1


@dataclass(frozen=True, slots=True)
class Row:
    """A kind of mutant.

    Attributes:
        kind: its name.
        words: what it changes.
        mutants: yields its mutants of a run; nothing if it does not apply.
    """

    kind: str
    words: str
    mutants: Callable[[Original], Iterable[Mutant]]


def _silenced(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("silenced", "", "no command reaches the robot", Mutation(silent=True))


def _swapped(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("swapped", "", "left and right are swapped in commands", Mutation(mirrored=True))


def _halved(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("halved", "", "all commands have half their speed", Mutation(speed=SLOWER))


def _doubled(original: Original) -> Iterator[Mutant]:
    if original.scenario.commands:
        yield original.mutant("doubled", "", "all commands have twice their speed", Mutation(speed=FASTER))


def _delayed(original: Original) -> Iterator[Mutant]:
    scenario = original.scenario
    if scenario.commands:
        late = tuple(source.model_copy(update={"latency": source.latency + DELAY_S}) for source in scenario.commands)
        words = f"all commands arrive {DELAY_S:g} s later"
        yield original.changed("delayed", "", words, scenario.model_copy(update={"commands": late}))


def _motors_off(original: Original) -> Iterator[Mutant]:
    for joint in _busy_joints(original)[:MOST_MOTORS]:
        words = f"the motor of joint '{joint}' is off"
        yield original.mutant("motor-off", joint, words, Mutation(dead_joint=joint))


def _busy_joints(original: Original) -> list[str]:
    """Return the joints whose motors have work to do: first wheels of the drive, then those that move, then others."""
    loaded, trace = original.loaded, original.trace
    ways = np.abs(np.diff(trace.joint_position, axis=0)).sum(axis=0).tolist()
    efforts = np.abs(trace.joint_effort).max(axis=0, initial=0.0).tolist()
    busy = {
        name: (way if way > _LEAST_MOTION else 0.0, effort)
        for name, way, effort in zip(trace.joint_names, ways, efforts, strict=True)
        if way > _LEAST_MOTION or effort > _LEAST_EFFORT
    }
    wheels: frozenset[str] = frozenset()
    if loaded.model is not None:
        busy = {name: work for name, work in busy.items() if loaded.model.why_not_driven(name) is None}
        drive = loaded.scenario.robot.drive or recognise(loaded.model)
        if drive is not None:
            wheels = drive.open(loaded.model, loaded.scenario.physics.rate).joints
    # Equal joints move equally far but for rounding.
    return sorted(busy, key=lambda name: (name not in wheels, *(-round(work, 1) for work in busy[name])))


def _heavier(original: Original) -> Iterator[Mutant]:
    if not original.scenario.robot.is_mjcf:
        yield original.mutant("heavier", "", "the robot has twice its mass", Mutation(mass=HEAVIER))


def _frozen(original: Original) -> Iterator[Mutant]:
    for mounted in _read_sensors(original):
        words = f"the sensor '{mounted.name}' repeats its first reading"
        yield original.mutant("frozen", mounted.name, words, Mutation(frozen_sensor=mounted.name))


def _noisy(original: Original) -> Iterator[Mutant]:
    for mounted in _read_sensors(original):
        if noise := _more_noise(mounted):
            noisy = replace(mounted, sensor=mounted.sensor.model_copy(update=noise))
            words = f"the sensor '{mounted.name}' has {NOISIER:g} times its noise"
            yield _with_sensors(original, "noisy", mounted, words, noisy)


def _more_noise(mounted: MountedSensor) -> dict[str, float]:
    """Return the keys of a sensor for its noise, with greater values."""
    sensor = mounted.sensor
    keys = NOISES.get(sensor.key, {key: 0.0 for key in type(sensor).model_fields if key.endswith("noise")})
    stated = {key: NOISIER * value for key in keys if isinstance(value := getattr(sensor, key), float) and value}
    return stated or {key: value for key, value in keys.items() if value}


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
    several = ((instead if each is mounted else (each,)) for each in original.scenario.sensors)
    sensors = tuple(each for some in several for each in some)
    return original.changed(kind, mounted.name, words, original.scenario.model_copy(update={"sensors": sensors}))


def _read_sensors(original: Original) -> list[MountedSensor]:
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
    Row("halved", "commanded speeds, efforts and forces are halved, and the way of joints from their start", _halved),
    Row(
        "motor-off",
        f"the motor of one joint is off; for the {MOST_MOTORS} joints that moved most, or bore most",
        _motors_off,
    ),
    Row(
        "removed",
        f"one object is missing; for the {world_faults.MOST_OBJECTS} nearest to the way",
        world_faults.removed,
    ),
    Row("frozen", "one sensor repeats its first reading", _frozen),
    Row("dropped", "ROS nodes get nothing from one sensor", _dropped),
    Row("slippery", "the friction of the ground is divided by 4", world_faults.slippery),
    Row(
        "shoved",
        f"a push against the upper edge of the robot, halfway through the run: in {world_faults.SHOVE_S:g} s it exerts "
        f"the momentum of the robot's mass at {world_faults.SHOVE_M_S:g} m/s, to the left",
        world_faults.shoved,
    ),
    Row(
        "doubled", "commanded speeds, efforts and forces are doubled, and the way of joints from their start", _doubled
    ),
    Row(
        "moved",
        "one object stands nearer to the way, or farther from an arm that comes to it, by its own size at most; "
        f"for the {world_faults.MOST_OBJECTS} nearest",
        world_faults.moved,
    ),
    Row("delayed", f"all commands arrive {DELAY_S:g} s later", _delayed),
    Row("heavier", "the robot has twice its mass", _heavier),
    Row("noisy", f"one sensor has {NOISIER:g} times its noise, or some if it has none", _noisy),
)
"""All kinds of mutants, the most telling first."""

KINDS: Final = tuple(row.kind for row in TABLE)
