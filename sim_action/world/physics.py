"""The ground and its patches, gravity, the physics steps, the limits of a stable run, and disturbances.

A disturbance is a force, torque or push at a given time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Final, Self

from pydantic import BeforeValidator, Field, model_validator

from sim_action.core import field_types, units
from sim_action.core.field_types import FrozenModel, Metres, Name, NonNegativeRatio, PositiveSeconds
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.state.timeline import TimeMark
from sim_action.world.parts import BoxPart

GROUND: Final = "ground"
Friction = Annotated[NonNegativeRatio, Field(le=100)]
Side = Annotated[Metres, Field(ge=0.01, le=1000)]


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[Friction, Field(description="multiplied with the friction of whatever touches it")] = 1.0


class Patch(FrozenModel):
    """An area of the ground with its own friction.

    It is level with the ground, which is cut around it, so there is no step. Contacts with a patch are contacts with
    the ground. Patches may touch but must not overlap; at most 50 are allowed. With patches, the ground ends at 10 km.
    """

    name: Annotated[Name | None, Field(description="for events")] = None
    x: Annotated[Metres, Field(ge=-1000, le=1000, description="centre of the patch")] = 0.0
    y: Annotated[Metres, Field(ge=-1000, le=1000, description="centre of the patch")] = 0.0
    size: Annotated[tuple[Side, Side], Field(description="size in x and y")]
    friction: Annotated[Friction, Field(description="friction in place of the ground's")]
    appears: Annotated[
        PositiveSeconds | None, Field(description="sim time from which on it has its own friction; default: always")
    ] = None

    @property
    def words(self) -> str:
        """The patch in words."""
        return f"the patch at ({self.x:g}, {self.y:g}) m with a friction of {self.friction:g}"

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The lower and upper bounds in x and in y, in m."""
        (width, depth) = self.size
        return (self.x - width / 2, self.x + width / 2), (self.y - depth / 2, self.y + depth / 2)


GROUND_REACH_M: Final = 10_000.0
"""The extent in m of the tiles from the origin of the world; a robot may not go farther by default."""

_TILE_DEPTH_M: Final = 10.0
_MIN_WIDTH_M: Final = 1e-6  # narrower gaps in m between patches are ignored
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Tile:
    """A piece of the ground with its upper side at z = 0."""

    part: BoxPart
    friction: float


def ground_tiles(ground: Ground, patches: Sequence[Patch]) -> tuple[Tile, ...]:
    """Return the patches at the start, in order, and the remaining ground around them; empty without patches."""
    if not patches:
        return ()
    around = [Tile(_box(across, along), ground.friction) for across, along in _rest(patches)]
    frictions = (patch.friction if patch.appears is None else ground.friction for patch in patches)
    areas = (_box(*patch.bounds) for patch in patches)
    return (*(Tile(area, friction) for area, friction in zip(areas, frictions, strict=True)), *around)


def _rest(patches: Sequence[Patch]) -> Iterator[tuple[Span, Span]]:
    """Yield the remaining ground as strips along x, cut at patches; equal neighbouring strips are merged."""
    cuts = sorted({-GROUND_REACH_M, GROUND_REACH_M, *(edge for patch in patches for edge in patch.bounds[0])})
    begun: dict[Span, float] = {}
    end = -GROUND_REACH_M
    for low, high in itertools.pairwise(cuts):
        if high - low < _MIN_WIDTH_M:
            continue
        gaps = set(_gaps([patch.bounds[1] for patch in patches if _covers(patch.bounds[0], low, high)]))
        for gap in [gap for gap in begun if gap not in gaps]:
            yield (begun.pop(gap), low), gap
        for gap in sorted(gaps):
            begun.setdefault(gap, low)
        end = high
    for gap, start in begun.items():
        yield (start, end), gap


def _covers(span: Span, low: float, high: float) -> bool:
    return span[0] <= low + _MIN_WIDTH_M and span[1] >= high - _MIN_WIDTH_M


def _gaps(spans: Sequence[Span]) -> Iterator[Span]:
    """Yield the gaps between spans that do not overlap."""
    at = -GROUND_REACH_M
    for start, end in sorted(spans):
        if start - at > _MIN_WIDTH_M:
            yield at, start
        at = end
    if GROUND_REACH_M - at > _MIN_WIDTH_M:
        yield at, GROUND_REACH_M


def _box(across: Span, along: Span) -> BoxPart:
    (left, right), (low, high) = across, along
    return BoxPart(
        (right - left, high - low, _TILE_DEPTH_M), Pose(((left + right) / 2, (low + high) / 2, -_TILE_DEPTH_M / 2))
    )


MAX_PHYSICS_RATE_HZ: Final = 100_000.0  # the greatest rate of physics steps in Hz, which also limits all other rates

MAX_SPEED: Final = 10_000.0
"""m/s and rad/s; engines limit the base and every joint to it, so speed limits cannot be higher."""


class Physics(field_types.FrozenModel):
    """The physics steps, and the limits beyond which a run is unstable."""

    rate: Annotated[
        field_types.PositiveHertz,
        Field(
            ge=1,
            le=MAX_PHYSICS_RATE_HZ,
            description="physics steps per second of sim time; default: the least rate from 240 Hz to 1000 Hz that all "
            "stated rates divide",
        ),
    ] = 240.0
    settle: Annotated[
        field_types.NonNegativeSeconds,
        Field(le=60, description="maximum time to come to rest before t = 0; 0: do not wait"),
    ] = 2.0
    max_speed: Annotated[
        field_types.MetresPerSecond,
        Field(gt=0, le=MAX_SPEED, description="speed of the base and of sliding joints from which the run is unstable"),
    ] = 100.0
    max_turn_rate: Annotated[
        field_types.RadiansPerSecond,
        Field(
            gt=0, le=MAX_SPEED, description="turn rate of the base and of turning joints from which the run is unstable"
        ),
    ] = 1000.0
    max_distance: Annotated[
        field_types.PositiveMetres,
        Field(description="distance of the base from its start from which the run is unstable"),
    ] = 10_000.0
    max_depth: Annotated[
        field_types.PositiveMetres | None,
        Field(
            description="depth of the base below ground from which the run is unstable; default: its extent plus 1 m"
        ),
    ] = None
    speculative: Annotated[
        bool, Field(description="stop most of what would pass through something within a step; MuJoCo only")
    ] = False


GRAVITY: Final = 9.80665  # m/s^2, standard gravity (CGPM 1901)
MAX_GRAVITY: Final = 1000.0  # m/s^2; forty times the gravity of Jupiter


def _vector(value: object) -> Vector3:
    """Return the vector of one number, which points downwards, or of three."""
    if not isinstance(value, (list, tuple)):
        down = _acceleration(value)
        if down < 0:
            raise ValueError(
                f"a single number points downwards and must be 0 or more; for upwards use [0, 0, {-down:g}]"
            )
        return (0.0, 0.0, -down)
    if len(value) != 3:
        raise ValueError(f"expected one number, or a list of three (x, y, z); found a list of {len(value)}")
    x, y, z = map(_acceleration, value)
    return (x, y, z)


def _acceleration(value: object) -> float:
    try:
        acceleration = units.parse(value, units.ACCELERATION)
    except units.UnitError as error:
        raise ValueError(str(error)) from None
    if abs(acceleration) > MAX_GRAVITY:
        raise ValueError(f"must be at most {MAX_GRAVITY:g} m/s^2, found {acceleration:g}")
    return acceleration


Gravity = Annotated[
    field_types.MetresPerSecondSquared
    | tuple[field_types.MetresPerSecondSquared, field_types.MetresPerSecondSquared, field_types.MetresPerSecondSquared],
    BeforeValidator(_vector),
    Field(description="downwards, or as [x, y, z]; may be 0", validate_default=True),
]


FELT_SHARE: Final = 0.01
"""A push, or an effort, below this share of a weight, or of the effort of a motor, tests nothing."""

MAX_FORCE: Final = 1e10
"""N and N m: a thousand times the weight of the heaviest body; more is a mistake and overflows in the engines."""

MAX_MASS: Final = 1e6  # the mass in kg of the heaviest body
Newtons = Annotated[float, Field(ge=-MAX_FORCE, le=MAX_FORCE), field_types.Quantity((units.FORCE,))]
NewtonMetres = Annotated[float, Field(ge=-MAX_FORCE, le=MAX_FORCE), field_types.Quantity((units.TORQUE,))]
PushMetresPerSecond = Annotated[field_types.MetresPerSecond, Field(ge=-MAX_SPEED, le=MAX_SPEED)]


class Disturbance(field_types.FrozenModel):
    """A force and a torque on a link or a body for some time, a push that changes its velocity, a load, or adhesion."""

    at: Annotated[field_types.NonNegativeSeconds, Field(description="sim time at which it starts")]
    duration: Annotated[
        field_types.PositiveSeconds | None,
        Field(
            alias="for",
            description="duration; needed by a force or a torque; a push has none; default of a payload, adhesion: on",
        ),
    ] = None
    link: Annotated[
        field_types.Name | None,
        Field(
            description="link of the robot; default without 'body': its base; of a payload of a bolted robot: its last "
            "one before fingers; or an <adhesion> of MJCF"
        ),
    ] = None
    body: Annotated[field_types.Name | None, Field(description="body of the world, instead of a link")] = None
    force: Annotated[
        tuple[Newtons, Newtons, Newtons] | None,
        Field(description="x, y, z in the world frame; acts at the centre of mass without 'point'"),
    ] = None
    point: Annotated[
        tuple[field_types.Coordinate, field_types.Coordinate, field_types.Coordinate] | None,
        Field(description="point at which the force acts, in the frame of the link or body"),
    ] = None
    torque: Annotated[
        tuple[NewtonMetres, NewtonMetres, NewtonMetres] | None, Field(description="x, y, z in the world frame")
    ] = None
    velocity: Annotated[
        tuple[PushMetresPerSecond, PushMetresPerSecond, PushMetresPerSecond] | None,
        Field(description="x, y, z in the world frame; added to the velocity of a body or of the whole robot"),
    ] = None
    payload: Annotated[
        Annotated[float, Field(ge=-MAX_MASS, le=MAX_MASS), field_types.Quantity((units.MASS,))] | None,
        Field(description="mass added to a link at its centre of mass; a negative one is taken from it"),
    ] = None

    adhesion: Annotated[
        Annotated[float, Field(ge=0, le=MAX_FORCE), field_types.Quantity((units.FORCE,))] | None,
        Field(description="holds what touches the link or body with up to this force, as a suction cup or a magnet"),
    ] = None

    def is_felt(self, mass: float) -> bool:
        """Return True if it is more than a hundredth of the weight of a mass in kg, or of 1 m/s."""
        force, torque, velocity = (math.hypot(*(v or (0.0,))) for v in (self.force, self.torque, self.velocity))
        pressing = max(force, torque, abs(self.payload or 0.0) * GRAVITY, self.adhesion or 0.0)
        return velocity > FELT_SHARE or pressing > FELT_SHARE * mass * GRAVITY

    def claims(self) -> Iterator[str]:
        """Yield why it has no effect."""
        if not any((*(self.force or ()), *(self.torque or ()), *(self.velocity or ()), self.payload, self.adhesion)):
            yield "the force, torque, velocity, payload or adhesion of this disturbance is zero; change or remove it"

    @property
    def end(self) -> float:
        """The end in s of sim time; infinite for a payload or adhesion without a duration."""
        lasts = self.payload is not None or self.adhesion is not None
        return math.inf if lasts and self.duration is None else self.at + (self.duration or 0.0)

    @property
    def time_mark(self) -> TimeMark:
        """The mark of the timeline."""
        target = f"body '{self.body}' " if self.body else f"link '{self.link}' " if self.link else ""
        amounts = (
            (self.force and math.hypot(*self.force), "pushed with", "N"),
            (self.torque and math.hypot(*self.torque), "turned with", "N m"),
            (self.velocity and math.hypot(*self.velocity), "pushed by", "m/s"),
            (self.payload, "loaded with", "kg"),
            (self.adhesion, "held by up to", "N"),
        )
        what = " and ".join(f"{word} {units.display(size, unit)}" for size, word, unit in amounts if size is not None)
        return TimeMark(self.at, None if self.end == math.inf else self.end, f"{target}{what}")

    def payload_at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the payload (T,) in kg at sim times in s."""
        acts = (time >= self.at - units.TIME_EPSILON_S) & (time < self.end - units.TIME_EPSILON_S)
        return acts.astype(float) * (self.payload or 0.0)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        pushes, presses = self.velocity is not None, self.force is not None or self.torque is not None
        if self.link is not None and self.body is not None:
            raise ValueError("give 'link' or 'body', not both; use two disturbances")
        if pushes + presses + (self.payload is not None) + (self.adhesion is not None) != 1:
            raise ValueError(
                "a disturbance needs 'force' and 'torque' (one or both), or 'velocity', or 'payload', or 'adhesion'"
            )
        if self.payload is not None and self.body is not None:
            raise ValueError("a 'payload' loads a link of the robot, not a 'body'")
        if presses and self.duration is None:
            raise ValueError("a force or a torque needs a duration, such as for: 0.1 s")
        if pushes and self.duration is not None:
            raise ValueError("a push of 'velocity' has no duration; remove 'for'")
        if self.point is not None and self.force is None:
            raise ValueError("'point' needs a 'force'")
        return self
