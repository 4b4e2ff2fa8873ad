"""The search for margins: factors of a scenario, the values that are tried, and where the scenario begins to fail.

A factor is a quantity of the scenario with a nominal value and a range. A scan runs some values of each direction.
Between the last value that passes and the first one that fails, bisection finds the threshold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, zip_longest
from types import MappingProxyType
from typing import Final

from sim_action.core import units
from sim_action.core.errors import ExitCode, InvalidScenario, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import did_you_mean, shown
from sim_action.core.yaml_document import KeyPath, NoSuchKey, placed, resolved
from sim_action.results.factor_margins import Margin
from sim_action.results.outcome import Outcome
from sim_action.runner.mutation.mutant import Original
from sim_action.runner.mutation.planning import busy_joints, noise_of, read_sensors
from sim_action.scenario.loading import Libraries, build_scene, checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.mutation import Mutation
from sim_action.sensors import MountedSensor
from sim_action.simulation.mutations import BIASES
from sim_action.state.readings import biased_columns

Edits = Iterable[tuple[KeyPath, object]]
_SCAN: Final = 4
# Bisection ends when its interval is this small, as a share of the range and of the margin.
_OF_RANGE: Final = 0.01
_OF_MARGIN: Final = 0.02
_SAME: Final = 1e-9
_MOST_LATENCY_S: Final = 1.0
_MOST_NOISE: Final = 20.0
_MOST_BIASES: Final = 5.0
_MASSES: Final = (0.2, 5.0)
_MOST_PAYLOAD_KG: Final = 100.0
_LEAST_STRENGTH: Final = 0.01
_MOST_PUSH: Final = 10.0
_PUSH_M_S: Final = 2.0
_SHIFT_M: Final = 1.0
_TURN_RAD: Final = 0.7853981633974483
_SLOWEST: Final = 0.05


@dataclass(frozen=True, slots=True)
class Factor:
    """A quantity of a scenario that can vary."""

    name: str  # its name, such as "friction", "noise:scan" or a dotted key
    unit: str  # the SI symbol of its values
    nominal: float  # nominal, low, high: its value in the scenario, and its range
    low: float
    high: float
    edits: Callable[[float], Edits] = lambda _: ()  # returns the keys of the scenario that state a value
    fitting: Callable[[float], float] = lambda value: value  # returns the nearest value that is possible
    is_mass: bool = False  # True if the value is a factor of the masses of the robot, which no key states

    def within(self, low: float, high: float) -> Factor:
        """Return the factor with another range. Raise UsageError if this does not contain the nominal value."""
        if not low <= self.nominal <= high or low == high:
            nominal = units.display(self.nominal, self.unit)
            raise UsageError(f"--factor {self.name}: the range does not contain the nominal value, {nominal}")
        return replace(self, low=low, high=high)

    def reaching(self, distance: float) -> Factor:
        """Return the factor with a range of at least a distance from the nominal value; not beyond zero, or new."""
        low = max(self.nominal - distance, 0.0) if self.low >= 0 else self.nominal - distance
        return replace(
            self,
            low=min(self.low, low) if self.low < self.nominal else self.low,
            high=max(self.high, self.nominal + distance) if self.high > self.nominal else self.high,
        )


def _paths(original: Original, key: str) -> list[KeyPath]:
    """Return the path of each entry of a list of the document; a single map is one."""
    data = original.loaded.document.data
    value = data.get(key, ()) if isinstance(data, dict) else ()
    return [(key, index) for index in range(len(value))] if isinstance(value, tuple) else [(key,)]


def _added(original: Original, path: KeyPath, *entries: object) -> Edits:
    """Return the edit that adds entries to a list of the document."""
    data = original.loaded.document.data
    for step in path:
        data = data.get(step, ()) if isinstance(data, dict) else ()
    before = data if isinstance(data, tuple) else filter(None, (data,))
    return [(path, (*before, *entries))]


def _friction(original: Original) -> Iterator[Factor]:
    world = original.scenario.world
    nominal = world.ground.friction

    def edits(value: float) -> Edits:
        yield ("world", "ground", "friction"), value
        for index, patch in enumerate(world.patches if nominal else ()):
            yield ("world", "patches", index, "friction"), patch.friction * value / nominal

    yield Factor("friction", "", nominal, 0.0, 2 * nominal or 1.0, edits)


def _payload(original: Original) -> Iterator[Factor]:
    model = original.loaded.model
    # Only the child knows the masses of a robot of xacro and MJCF.
    most = 2 * model.mass if model is not None and model.mass else _MOST_PAYLOAD_KG
    # Messages then name the link of an arm.
    link = {"link": build_scene(original.loaded).load_link} if model is not None and original.is_fixed else {}
    path = ("world", "disturbances")
    yield Factor("payload", "kg", 0.0, 0.0, most, lambda kg: _added(original, path, {"at": 0, "payload": kg, **link}))


def _mass(original: Original) -> Iterator[Factor]:
    del original
    yield Factor("mass", "", 1.0, *_MASSES, is_mass=True)


def _latency(original: Original) -> Iterator[Factor]:
    pairs = list(zip(_paths(original, "commands"), original.scenario.commands, strict=False))
    if pairs:
        nominal = max(source.latency for _, source in pairs)

        def edits(value: float) -> Edits:
            return [((*path, "latency"), source.latency + value - nominal) for path, source in pairs]

        yield Factor("latency", "s", nominal, nominal, nominal + _MOST_LATENCY_S, edits)


def _command_rate(original: Original) -> Iterator[Factor]:
    paths, physics = _paths(original, "commands"), original.scenario.physics.rate
    if len(rates := {source.rate for source in original.scenario.commands}) == 1:
        [nominal] = rates

        def fitting(value: float) -> float:
            return physics / max(1, round(physics / value))

        least = fitting(_SLOWEST * nominal)
        edits = _placed(*((*path, "rate") for path in paths))
        yield Factor("command-rate", "Hz", nominal, least, physics, edits, fitting)


def _noise(original: Original) -> Iterator[Factor]:
    for path, mounted in _read(original):
        base, is_stated = noise_of(mounted.sensor)
        if base:
            edits = _scaled((*path, mounted.sensor.key), base)
            yield Factor(f"noise:{mounted.name}", "", float(is_stated), 0.0, _MOST_NOISE, edits)


def _scaled(path: KeyPath, base: dict[str, float]) -> Callable[[float], Edits]:
    return lambda value: (((*path, key), value * amount) for key, amount in base.items())


def _bias(original: Original) -> Iterator[Factor]:
    for _, mounted in _read(original):
        for name, column in list(biased_columns(mounted.sensor.key).items())[:1]:
            most = _MOST_BIASES * BIASES.get(column.dimension.si, 1.0)
            edits = _biased(original, mounted.name, name)
            yield Factor(f"bias:{mounted.name}", column.dimension.si, 0.0, -most, most, edits)


def _biased(original: Original, sensor: str, column: str) -> Callable[[float], Edits]:
    return lambda value: _added(original, ("faults",), {"sensor": sensor, "at": 0, "biased": {column: value}})


def _read(original: Original) -> Iterator[tuple[KeyPath, MountedSensor]]:
    """Yield the sensors that something reads, each with its path."""
    sensors = read_sensors(original)
    pairs = zip(_paths(original, "sensors"), original.scenario.sensors, strict=False)
    yield from ((path, mounted) for path, mounted in pairs if mounted in sensors)


def _motor_strength(original: Original) -> Iterator[Factor]:
    if joints := busy_joints(original):

        def edits(value: float) -> Edits:
            return _added(original, ("faults",), *({"motor": joint, "at": 0, "weak": value} for joint in joints))

        yield Factor("motor-strength", "", 1.0, _LEAST_STRENGTH, 1.0, edits)


def _push(original: Original) -> Iterator[Factor]:
    pushes = {
        ("world", "disturbances", index, key): vector
        for index, disturbance in enumerate(original.scenario.world.disturbances)
        for key in ("force", "torque", "velocity")
        if (vector := getattr(disturbance, key))
    }
    if pushes:

        def scaled(value: float) -> Edits:
            return [(path, tuple(value * part for part in vector)) for path, vector in pushes.items()]

        yield Factor("push", "", 1.0, 0.0, _MOST_PUSH, scaled)
    elif not original.is_fixed:
        at = (original.outcome.sim_time or 0.0) / 2

        def added(value: float) -> Edits:
            return _added(original, ("world", "disturbances"), {"at": at, "velocity": (0, value, 0)})

        yield Factor("push", "m/s", 0.0, -_PUSH_M_S, _PUSH_M_S, added)


def _start(original: Original) -> Iterator[Factor]:
    robot = original.scenario.robot
    # A keyframe states the heading unless the scenario does.
    is_stated = robot.keyframe is None or "yaw" in robot.pose.model_fields_set
    yaw = robot.pose.yaw if is_stated else float(original.trace.yaw[0])
    if not robot.name_in_world:
        for axis, nominal, way, unit in (
            ("x", robot.pose.x, _SHIFT_M, "m"),
            ("y", robot.pose.y, _SHIFT_M, "m"),
            ("yaw", yaw, _TURN_RAD, "rad"),
        ):
            yield Factor(f"start:{axis}", unit, nominal, nominal - way, nominal + way, _placed(("robot", "pose", axis)))


def _placed(*paths: KeyPath) -> Callable[[float], Edits]:
    return lambda value: [(path, value) for path in paths]


FACTORS: Final[Mapping[str, Callable[[Original], Iterable[Factor]]]] = MappingProxyType(
    {
        "friction": _friction,
        "payload": _payload,
        "mass": _mass,
        "latency": _latency,
        "command-rate": _command_rate,
        "noise": _noise,
        "bias": _bias,
        "motor-strength": _motor_strength,
        "push": _push,
        "start": _start,
    }
)
"""Name -> the function that yields the factors of a run; nothing if the run has none."""


@dataclass(frozen=True, slots=True)
class FactorRequest:
    """A factor that the command line names."""

    name: str  # of a row, of one of its factors, or a dotted key
    bounds: tuple[float, float] | None = None  # its range; None: the range in the table
    # share, distance: what must be left, as a part of the nominal value, or in its unit; None: nothing is demanded
    share: float | None = None
    distance: float | None = None
    unit: str = ""  # the SI symbol of the bounds and the distance, as far as they state one

    @classmethod
    def parsed(cls, factors: Iterable[str], at_least: Iterable[str]) -> tuple[FactorRequest, ...]:
        """Return the requests in texts such as "latency=0 s:2 s" and "friction=20%". Raise UsageError."""
        requests: dict[str, FactorRequest] = {}
        for text in factors:
            name, equals, bounds = text.partition("=")
            requests[name] = cls(name)
            if equals:
                low, colon, high = bounds.partition(":")
                if not colon or ":" in high:
                    raise UsageError(f"--factor: expected KEY=FROM:TO, found '{text}'")
                (first, unit), (last, other) = _number(low, "--factor"), _number(high, "--factor")
                if unit != other:
                    raise UsageError(f"--factor: both ends need the same unit: '{text}'")
                requests[name] = cls(name, (first, last), unit=unit)
        for text in at_least:
            name, _, amount = text.partition("=")
            number, unit = _number(amount.strip().removesuffix("%"), "--at-least")
            if not number > 0:
                raise UsageError(f"--at-least: expected FACTOR=AMOUNT, such as friction=20%, found '{text}'")
            request = requests.get(name, cls(name))
            if amount.rstrip().endswith("%"):
                requests[name] = replace(request, share=number / 100)
            else:
                requests[name] = replace(request, distance=number, unit=request.unit or unit)
        return tuple(requests.values())

    def least(self, factor: Factor) -> float | None:
        """Return the distance from the nominal value that must be left. Raise UsageError."""
        if self.share is None:
            return self.distance
        if not factor.nominal:
            raise UsageError(
                f"--at-least {self.name}: the nominal value is 0, so it has no share; demand an amount in {factor.unit}"
            )
        return self.share * abs(factor.nominal)

    def factors(self, original: Original) -> list[Factor]:
        """Return the factors of a run that are meant. Raise UsageError."""
        kind = self.name.partition(":")[0]
        factors = FACTORS[kind](original) if kind in FACTORS else [self._of_key(original)]
        chosen = [factor for factor in factors if self.name in (kind, factor.name)]
        for factor in chosen:
            if self.unit not in ("", factor.unit):
                raise UsageError(f"{self.name} has the unit '{factor.unit}', not '{self.unit}'")
        return [factor if self.bounds is None else factor.within(*self.bounds) for factor in chosen]

    def _of_key(self, original: Original) -> Factor:
        document = original.loaded.document
        try:
            path = resolved(document.data, self.name)
            value = document.data
            for step in path:
                value = value[step]  # type: ignore[index] # the path leads through maps and lists
            nominal, unit = units.with_si_unit(value)
        except (NoSuchKey, KeyError, TypeError, units.UnitError):
            message = f"{shown(self.name)} is neither a factor nor a key of {document.file} with a number"
            raise UsageError(f"{message}{did_you_mean(self.name, FACTORS)}; state its nominal value there") from None
        if self.bounds is None:
            raise UsageError(f"{self.name}: a key needs a range, such as --factor {self.name}=FROM:TO")
        return Factor(self.name, unit or self.unit, nominal, nominal, nominal, _placed(path))


def _number(text: str, option: str) -> tuple[float, str]:
    """Return a number in SI units, and the unit. Raise UsageError."""
    try:
        return units.with_si_unit(text.strip())
    except units.UnitError as error:
        raise UsageError(f"{option}: {error}") from None


def trial(original: Original, factor: Factor, value: float, permissions: Permissions, libraries: Libraries) -> Trial:
    """Return the scenario with another value of a factor, or the reason why it is not valid."""
    loaded, scenario = original.loaded, original.scenario
    data = loaded.document.data
    # Another rate of commands must not change the rate of the physics.
    for path, content in ((("physics", "rate"), scenario.physics.rate), *factor.edits(value)):
        data, _ = placed(data, path, content)
    source = replace(loaded.source, document=replace(loaded.document, data=data), gate=None)
    try:
        changed = checked(source, permissions, libraries)
    except InvalidScenario as error:
        return Trial(value, reason=str(error.problems[0].message))
    name = f"{scenario.name} ({factor.name} {units.display(value, factor.unit)})"
    kept = {"name": name, "backend": scenario.backend, "seed": scenario.seed, "unexercised": scenario.unexercised}
    return Trial(
        value,
        replace(
            changed,
            scenario=changed.scenario.model_copy(update=kept),
            strict=loaded.strict,
            mutation=Mutation(mass=value) if factor.is_mass else None,
        ),
    )


@dataclass(slots=True)
class Trial:
    """A value of a factor that was tried."""

    value: float
    loaded: LoadedScenario | None = None  # the scenario with it; None if it is not valid
    reason: str = ""  # the reason why it failed, or is not valid; or empty
    expectation: str = ""  # the expectation that failed first; or empty
    digest: str | None = None
    has_passed: bool | None = None  # True if the scenario passed; None if it did not run

    def take(self, outcome: Outcome) -> None:
        """Keep what the search needs of the outcome of its run."""
        self.loaded, self.digest = None, outcome.digest
        if outcome.exit_code == ExitCode.INVALID:  # only the child could check it
            self.reason = outcome.reasons[0]
            return
        self.has_passed = outcome.status == "passed"
        first = min(outcome.causes, key=lambda expected: expected.verdict.time or 0.0, default=None)
        if first is not None:
            self.expectation, self.reason = first.name, first.message
        elif not self.has_passed:
            self.reason = outcome.ending


@dataclass(slots=True)
class Side:
    """The search for the margin of a factor in one direction."""

    factor: Factor
    end: float  # the end of the range
    asked: float | None  # the distance from the nominal value that is demanded
    trials: list[Trial] = field(default_factory=list)  # the trials that have ended, or are not valid

    def scan(self) -> list[float]:
        """Return the values to try first."""
        nominal, span = self.factor.nominal, self.end - self.factor.nominal
        values = [nominal + span * step / _SCAN for step in range(1, _SCAN + 1)]
        if self.asked is not None and self.asked <= abs(span):
            values.append(nominal + (self.asked if span > 0 else -self.asked))
        return sorted(filter(self._is_new, {self.factor.fitting(value) for value in values}), key=self._distance)

    def _distance(self, value: float) -> float:
        return abs(value - self.factor.nominal)

    def _is_new(self, value: float) -> bool:
        others = (self.factor.nominal, *(trial.value for trial in self.trials))
        return all(abs(value - other) > _SAME * abs(self.end - self.factor.nominal) for other in others)

    @property
    def ran(self) -> list[Trial]:
        """The trials that ran, the nearest one first."""
        ran = (trial for trial in self.trials if trial.has_passed is not None)
        return sorted(ran, key=lambda trial: self._distance(trial.value))

    @property
    def bracket(self) -> tuple[float, Trial | None]:
        """The last value that passes, and the first trial that fails."""
        passed = self.factor.nominal
        for one in self.ran:
            if not one.has_passed:
                return passed, one
            passed = one.value
        return passed, None

    def middle(self) -> float | None:
        """Return the next value of the bisection; None at its end."""
        passed, failed = self.bracket
        if failed is None:
            return None
        width = abs(failed.value - passed)
        value = self.factor.fitting((failed.value + passed) / 2)
        is_fine = width <= min(_OF_RANGE * self._distance(self.end), _OF_MARGIN * self._distance(value))
        return None if is_fine or not self._is_new(value) else value

    def has_effect(self, digest: str | None) -> bool:
        """Return True if a run failed, or moved in another way than that with the nominal value, of this digest."""
        return any(trial.digest != digest or not trial.has_passed for trial in self.ran)

    def margin(self, *, has_effect: bool) -> Margin:
        """Return the margin; `has_effect`: see `Margin`."""
        (passed, failed), ran = self.bracket, self.ran
        verdicts = [True, *(bool(trial.has_passed) for trial in ran)]
        unable = "" if ran else next((tried.reason for tried in self.trials), "no run was left")
        return Margin(
            factor=self.factor.name,
            direction="down" if self.end < self.factor.nominal else "up",
            unit=self.factor.unit,
            nominal=self.factor.nominal,
            end=max((trial.value for trial in ran), key=self._distance, default=self.end),
            passes=passed,
            fails=None if failed is None else failed.value,
            expectation="" if failed is None else failed.expectation,
            reason=unable if failed is None else failed.reason,
            crossings=sum(one != other for one, other in pairwise(verdicts)),
            runs=len(ran),
            has_effect=has_effect,
            asked=self.asked,
        )


class Search:
    """The search for the margins of one factor in both directions."""

    def __init__(self, factor: Factor, asked: float | None, most: int) -> None:
        """Take the distance that is demanded, and the largest number of runs."""
        self.factor = factor if asked is None else factor.reaching(asked)
        ends = [end for end in (self.factor.low, self.factor.high) if end != factor.nominal]
        self.sides = [Side(self.factor, end, asked) for end in ends]
        self._left, self._has_scanned = most, False

    @classmethod
    def of_missing(cls, name: str) -> Search:
        """Return the search for a factor that must have a margin, and that the run does not have."""
        search = cls(Factor(name, "", 0.0, 0.0, 0.0), None, 0)
        search.sides = [Side(search.factor, 0.0, 0.0, [Trial(0.0, reason="the scenario has no such factor")])]
        return search

    def next_values(self) -> Sequence[tuple[Side, float]]:
        """Return the next values to try."""
        if self._has_scanned:
            pairs = [(side, value) for side in self.sides if (value := side.middle()) is not None]
        else:
            # The directions take turns, so that few runs leave none of them out.
            scans = [[(side, value) for value in side.scan()] for side in self.sides]
            pairs = [pair for several in zip_longest(*scans) for pair in several if pair is not None]
        self._has_scanned = True
        taken = pairs[: self._left]
        self._left -= len(taken)
        return taken

    def margins(self, digest: str | None) -> Iterator[Margin]:
        """Yield the margin of each direction; `digest`: of the run with the nominal value."""
        has_effect = any(side.has_effect(digest) for side in self.sides)
        yield from (side.margin(has_effect=has_effect) for side in self.sides)
