"""The inputs of a policy: the terms of its observation, how they are read from the robot, and pictures of cameras."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, PlainValidator, WithJsonSchema, model_validator

from sim_action.core.field_types import FrozenModel, PositiveSeconds
from sim_action.core.geometry import Vector3, conjugate, rotate, rpy_from_quaternion
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, field
from sim_action.core.wording import FirstFew, counted, did_you_mean, shown
from sim_action.core.yaml_document import SpecProblem, SpecProblems
from sim_action.networks.onnx_network import FLOATS, Tensor
from sim_action.robot.model.joint_selection import chosen, matches_name, name_problem
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.sensors.camera import Camera
from sim_action.state.observation import Observation
from sim_action.state.readings import columns_of
from sim_action.world.scene import Scene

_OF_JOINTS: Final = ("joints.position", "joints.velocity", "joints.effort")
_PHASES: Final = ("phase.sin", "phase.cos")
_SIZES: Final[Mapping[str, int]] = {
    "base.linear": 3,
    "base.angular": 3,
    "base.rpy": 3,
    "base.height": 1,
    "gravity": 3,
    "commands": 3,
    "time": 1,
    **dict.fromkeys(_PHASES, 1),
}
TERMS: Final = (*_SIZES, *_OF_JOINTS, "last_action")  # the terms besides terms of sensors
_SENSORS: Final = "sensors."
_UNREADABLE: Final = frozenset({"camera"})  # kinds of sensors without terms


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _per_joint(value: object, words: str = "") -> object:
    """Return a value for all joints, one for each, or values by name. Raises ValueError, which begins with `words`."""
    parts: Iterable[object] = (value,)
    if isinstance(value, dict):
        parts = value.values()
    elif isinstance(value, tuple):
        parts = value
    if not all(map(_is_number, parts)) or value in ((), {}):
        raise ValueError(
            f"expected {words}a number, a list with a number for each joint, or a map of joint names to numbers, found "
            f"{shown(value)}"
        )
    return value


def _offset(value: object) -> object:
    return value if value == HOME else _per_joint(value, f"'{HOME}', ")


HOME: Final = "home"
_BY_NAME: Final[dict[str, Any]] = {"type": "object", "additionalProperties": {"type": "number"}}
_NUMBERS: Final[list[dict[str, Any]]] = [{"type": "number"}, {"type": "array", "items": {"type": "number"}}, _BY_NAME]

PerJoint = Annotated[
    float | tuple[float, ...] | Mapping[str, float], PlainValidator(_per_joint), WithJsonSchema({"anyOf": _NUMBERS})
]
"""A number for all joints, a list with one for each, or a map of joint names and patterns to numbers."""

Offset = Annotated[
    Literal["home"] | float | tuple[float, ...] | Mapping[str, float],
    PlainValidator(_offset),
    WithJsonSchema({"anyOf": [{"type": "string", "enum": [HOME]}, *_NUMBERS]}),
]
"""A position for joints, or `home`."""


class Term(FrozenModel):
    """One term of an observation. Its name alone is enough."""

    term: Annotated[str, Field(description="name of the term")]
    scale: Annotated[PerJoint, Field(description="factor for the numbers of the term")] = 1.0
    clip: Annotated[
        float | None, Field(gt=0, description="largest absolute value, applied after the scale; default: none")
    ] = None
    joints: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="other joints for a term of joints: names and patterns in their order"),
    ] = None
    offset: Annotated[
        Offset | None,
        Field(description="subtracted from `joints.position`; default: the `offset` of a position action"),
    ] = None
    period: Annotated[PositiveSeconds | None, Field(description="period of `phase.sin` and `phase.cos`")] = None
    shift: Annotated[float, Field(description="share of the period that is added to the phase")] = 0.0
    frames: Annotated[
        int | None,
        Field(ge=1, le=1000, description="number of its values over time, oldest first; default: that of `history`"),
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _takes_name_alone(cls, data: Any) -> Any:
        return {"term": data} if isinstance(data, str) else data

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.sensor is None and self.term not in TERMS:
            raise ValueError(f"unknown term '{self.term}'{did_you_mean(self.term, (*TERMS, 'sensors.NAME.COLUMN'))}")
        if (self.period is None) == (self.term in _PHASES):
            needs = "needs a 'period'" if self.term in _PHASES else "has no 'period'"
            raise ValueError(f"'{self.term}' {needs}")
        if self.shift and self.term not in _PHASES:
            raise ValueError(f"'{self.term}' has no 'shift'")
        if self.offset is not None and self.term != "joints.position":
            raise ValueError(f"'{self.term}' has no 'offset'; only joints.position has")
        if self.joints is not None and self.term not in _OF_JOINTS:
            raise ValueError(f"'{self.term}' has no 'joints'")
        return self

    @property
    def sensor(self) -> tuple[str, str] | None:
        """The name of a sensor and of one of its columns, for a term such as `sensors.imu.angular_velocity_xyz`."""
        name, _, column = self.term.removeprefix(_SENSORS).rpartition(".")
        return (name, column) if self.term.startswith(_SENSORS) and name and column else None

    def problems(self, scene: Scene, layout: Layout) -> SpecProblems:
        """Yield unknown joints and sensors."""
        if self.joints is not None:
            yield from ((("joints", index), text) for index, text in selection_problems(scene.model, self.joints))
        if self.sensor is not None and (problem := _sensor_problem(scene, *self.sensor)) is not None:
            yield ("term",), problem
        names = layout.of(self)
        if self.offset not in (None, HOME):
            yield from per_joint_problems("offset", self.offset, names)
        if self.term == "gravity" and not scene.world.weight:
            yield ("term",), "the world has no gravity; change world.gravity, or remove the term"
        size = self.size(layout)
        if isinstance(self.scale, Mapping) and self.term not in _OF_JOINTS:
            yield ("scale",), f"'{self.term}' is not a term of joints; give a number, or a list of {size} numbers"
        elif isinstance(self.scale, tuple) and size is not None and len(self.scale) != size:
            yield ("scale",), f"has {len(self.scale)} numbers, and '{self.term}' has {size}"
        elif isinstance(self.scale, Mapping):
            yield from per_joint_problems("scale", self.scale, names)

    def size(self, layout: Layout) -> int | None:
        """Return the number of values; None: only the first reading shows it."""
        if self.sensor is not None:
            return layout.columns.get(self.sensor)
        if self.term in _OF_JOINTS:
            return len(layout.of(self))
        return layout.actions if self.term == "last_action" else _SIZES[self.term]

    def reader(self, layout: Layout) -> Reader:
        """Return a function from the state to the values, before scale and clip."""
        if self.term in _OF_JOINTS:
            reading = self.term.removeprefix("joints.")
            offsets = layout.offsets(self) if reading == "position" else [0.0] * len(layout.of(self))
            pairs = list(zip(layout.of(self), offsets, strict=True))
            return lambda now: [getattr(now.joints[name], reading) - offset for name, offset in pairs]
        if self.term in _PHASES:
            wave = math.sin if self.term == "phase.sin" else math.cos
            return lambda now: (wave(2 * math.pi * math.fmod(now.time / (self.period or 1.0) + self.shift, 1.0)),)
        if self.term == "gravity":
            return lambda now: _in_base(now, layout.down_xyz)
        return _READERS.get(self.term) or self._sensor_reader()

    def _sensor_reader(self) -> Reader:
        assert self.sensor is not None
        name, column = self.sensor

        def read(now: Observation) -> Sequence[float]:
            return [float(number) for number in np.ravel(now.sensors[name].columns()[column])]

        return read


Reader = Callable[["Observation"], Sequence[float]]


def _in_base(now: Observation, vector: Vector3) -> Vector3:
    return rotate(conjugate(now.pose.orientation_xyzw), vector)


_READERS: Final[Mapping[str, Reader]] = {
    "base.linear": lambda now: _in_base(now, now.twist.linear_xyz),
    "base.angular": lambda now: _in_base(now, now.twist.angular_xyz),
    "base.rpy": lambda now: rpy_from_quaternion(now.pose.orientation_xyzw),
    "base.height": lambda now: now.pose.position_xyz[2:],
    "time": lambda now: (now.time,),
}


@dataclass(frozen=True, slots=True)
class Layout:
    """The facts of a robot that the sizes of terms depend on."""

    model: RobotModel  # of the robot
    joints: tuple[str, ...]  # the joints of the network, in its order
    actions: int  # the number of values of an action
    home: Mapping[str, float]  # joint name -> position at the start, rad (m)
    offset: Offset = 0.0  # of a position action
    # sensor and column -> number of values, where it is known before the run
    columns: Mapping[tuple[str, str], int] = field(default_factory=dict)
    down_xyz: Vector3 = (0.0, 0.0, -1.0)  # the direction of gravity in the world

    def of(self, term: Term) -> tuple[str, ...]:
        """Return the joints of a term."""
        return self.joints if term.joints is None else selected(self.model, term.joints)

    def offsets(self, term: Term) -> list[float]:
        """Return the number that is subtracted from the position of each joint of a term."""
        return values_of(self.offset if term.offset is None else term.offset, self.of(term), self.home)


def sensor_sizes(scene: Scene) -> dict[tuple[str, str], int]:
    """Return the number of values of each column of the sensors, where it is always the same."""
    return {
        (fitted.name, name): len(column.axes) or 1
        for fitted in scene.sensors
        for name, column in columns_of(fitted.kind).items()
        if not column.many
    }


def _sensor_problem(scene: Scene, name: str, column: str) -> str | None:
    kinds = {fitted.name: fitted.kind for fitted in scene.sensors}
    if name not in kinds:
        return f"the scenario has no sensor '{name}'{did_you_mean(name, kinds)}"
    columns = {} if kinds[name] in _UNREADABLE else columns_of(kinds[name])
    return None if column in columns else f"sensor '{name}' has no column '{column}'{did_you_mean(column, columns)}"


def selected(model: RobotModel, names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the joints of names and patterns in their order, each once; None: all that a motor can move."""
    driven = [joint.name for joint in model.moving_joints if model.why_not_driven(joint.name) is None]
    if names is None:
        return tuple(driven)
    matched = [joint.name for name in names for joint in _meant(model, name, driven)]
    return tuple(dict.fromkeys(matched))


def _meant(model: RobotModel, name: str, driven: Sequence[str]) -> list[Joint]:
    return [joint for joint in chosen(model, (name,)) if joint.name == name or joint.name in driven]


def selection_problems(model: RobotModel, names: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Yield the indices of names that no joint matches, with the problem."""
    hinted = FirstFew()
    for index, name in enumerate(names):
        if (problem := name_problem(model, name, hinted)) is not None:
            yield index, problem


def per_joint_problems(key: str, value: Any, joints: Sequence[str]) -> Iterator[SpecProblem]:
    """Yield a list of another length, names that no joint has, and joints without a value."""
    if isinstance(value, tuple) and len(value) != len(joints):
        names = ", ".join(joints[:3]) + (", ..." if len(joints) > 3 else "")
        yield (key,), f"has {counted(len(value), 'number')} for {counted(len(joints), 'joint')} ({names})"
    if not isinstance(value, Mapping):
        return
    for name in value:
        if not any(matches_name(name, joint) for joint in joints):
            yield (key, name), f"no joint of the policy matches '{name}'{did_you_mean(name, joints)}"
    bare = next((joint for joint in joints if not any(matches_name(name, joint) for name in value)), None)
    if bare is not None:
        yield (key,), f"joint '{bare}' has no value; add it, or a pattern such as '*'"


def values_of(value: Any, joints: Sequence[str], home: Mapping[str, float]) -> list[float]:
    """Return the value of each joint; of a map, the first entry that matches."""
    if value == HOME:
        return [home[joint] for joint in joints]
    if isinstance(value, Mapping):
        return [next(number for name, number in value.items() if matches_name(name, joint)) for joint in joints]
    return [float(number) for number in value] if isinstance(value, tuple) else [float(value)] * len(joints)


_COLOURS: Final = 3
_PerColour = float | Annotated[tuple[float, ...], Field(min_length=_COLOURS, max_length=_COLOURS)]


class Picture(FrozenModel):
    """The image of a camera as an input: `(pixel * scale - mean) / std`, with pixels from 0 to 255."""

    camera: Annotated[str, Field(description="name of a camera in `sensors`")]
    layout: Annotated[
        Literal["nchw", "nhwc"], Field(description="order of samples (N), colours (C), rows (H) and columns (W)")
    ] = "nchw"
    scale: Annotated[
        float | None, Field(gt=0, description="factor for pixels; default: 1/255 for an input of floats, else 1")
    ] = None
    mean: Annotated[_PerColour, Field(description="subtracted: a number, or one for red, green and blue")] = 0.0
    std: Annotated[_PerColour, Field(description="divisor: a number, or one for red, green and blue")] = 1.0

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield a camera that the scenario does not have, and a divisor of 0."""
        cameras = [sensor.name for sensor in scene.sensors if isinstance(sensor.keys, Camera)]
        if self.camera not in cameras:
            yield ("camera",), f"the scenario has no camera '{self.camera}'{did_you_mean(self.camera, cameras)}"
        if 0.0 in (self.std if isinstance(self.std, tuple) else (self.std,)):
            yield ("std",), "must not be 0: it divides"

    def shape(self, scene: Scene, tensor: Tensor) -> tuple[int, ...]:
        """Return the shape of the input; 1 in each dimension that the network has in addition."""
        keys = next(sensor.keys for sensor in scene.sensors if sensor.name == self.camera)
        assert isinstance(keys, Camera)
        rows, columns = keys.height, keys.width
        inner = (_COLOURS, rows, columns) if self.layout == "nchw" else (rows, columns, _COLOURS)
        return (*([1] * (max(len(tensor.shape), len(inner)) - len(inner) if tensor.shape else 1)), *inner)


class PictureInput:
    """The value of an input that takes a picture."""

    def __init__(self, picture: Picture, tensor: Tensor, shape: tuple[int, ...]) -> None:
        self._picture, self._type, self._shape = picture, tensor.type, shape
        default = 1 / 255 if tensor.type in FLOATS else 1.0
        self._scale = default if picture.scale is None else picture.scale
        self._mean, self._std = np.array(picture.mean), np.array(picture.std)

    def value(self, now: Observation, _: object) -> NDArray[Any]:
        """Return the value for this tick."""
        # A reading of another kind of sensor was refused before the run.
        pixels = np.asarray(now.sensors[self._picture.camera].columns()["rgb"])
        values = (pixels * self._scale - self._mean) / self._std
        if self._picture.layout == "nchw":
            values = np.moveaxis(values, -1, 0)
        if self._type not in FLOATS:
            limits = np.iinfo(self._type)
            values = np.clip(np.rint(values), limits.min, limits.max)
        return np.ascontiguousarray(values.reshape(self._shape), dtype=self._type)
