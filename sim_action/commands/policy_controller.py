"""The controller of a policy: observations into the network, its output into targets of the joints."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from sim_action.commands.policy_terms import (
    Layout,
    Offset,
    PerJoint,
    PictureInput,
    Reader,
    Term,
    per_joint_problems,
    values_of,
)
from sim_action.commands.twist import TwistSegment
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import FrozenModel
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, field
from sim_action.core.wording import counted
from sim_action.core.yaml_document import SpecProblems
from sim_action.networks.onnx_network import FLOATS, NetworkProblem, Session, Tensor
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation

if TYPE_CHECKING:
    Vector = NDArray[np.float64]


_ROUNDING: Final = 1e-9  # sim time is step / rate, so equal times may differ by rounding


def _not_negative(value: Any) -> Any:
    """Raise ValueError for a negative number: a spring or a damper that pushes away from its target."""
    numbers = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
    for number in numbers:
        if number is not None and number < 0:
            raise ValueError(f"must be at least 0, found {number:g}: the joint would move away from its target")
    return value


class PolicyAction(FrozenModel):
    """The meaning of the network's output: one number for each joint."""

    joints: Annotated[
        Literal["position", "velocity", "effort"], Field(description="quantity of the joints that the output commands")
    ]
    scale: Annotated[PerJoint, Field(description="factor for the output")] = 1.0
    offset: Annotated[
        Offset, Field(description="added after `scale`: rad (m), or `home`, the positions at which the robot starts")
    ] = 0.0
    clip: Annotated[float | None, Field(gt=0, description="largest absolute output, before `scale`; default: none")] = (
        None
    )
    stiffness: Annotated[
        PerJoint | None,
        AfterValidator(_not_negative),
        Field(description="N m/rad (N/m) of a spring to the target, computed at every physics step; default: a servo"),
    ] = None
    damping: Annotated[
        PerJoint | None,
        AfterValidator(_not_negative),
        Field(description="N m s/rad (N s/m); with `stiffness`, or for a target velocity"),
    ] = None
    choices: Annotated[
        tuple[float | tuple[float, ...], ...] | None,
        Field(
            min_length=2,
            description="discrete actions: the values of each, one for each joint; the output is a score for each, of "
            "which the highest counts, or the index of one",
        ),
    ] = None
    execute: Annotated[
        int | None,
        Field(ge=1, description="for an output of several actions, one for each tick: number that is executed of them"),
    ] = None
    ensemble: Annotated[
        float | None,
        Field(
            ge=0,
            description="for an output of several actions: the network runs at each tick, and all actions for that "
            "tick are averaged with the weights `exp(-ensemble * i)`; `i` is 0 for the oldest",
        ),
    ] = None

    @property
    def is_soft(self) -> bool:
        """True if a spring or a damper computes the efforts."""
        return (self.stiffness, self.damping) != (None, None)

    def problems(self, *, is_perfect: bool) -> SpecProblems:
        """Yield keys that do not fit together; `is_perfect`: without latency, jitter and dropouts."""
        if self.joints == "position" and (self.stiffness is None) != (self.damping is None):
            yield ("action",), "a target position needs both of 'stiffness' and 'damping', or none of them"
        if self.joints == "velocity" and self.stiffness is not None:
            yield ("action", "stiffness"), "a target velocity has 'damping' alone"
        if self.joints == "effort" and self.is_soft:
            yield ("action",), "an effort is applied directly; remove 'stiffness' and 'damping'"
        elif self.is_soft and not is_perfect:
            yield ("action",), "'stiffness' and 'damping' cannot be combined with latency, jitter or dropouts"
        if [self.choices, self.execute, self.ensemble].count(None) < 2:
            yield ("action",), "'choices', 'execute' and 'ensemble' cannot be combined"

    def joint_problems(self, joints: Sequence[str]) -> SpecProblems:
        """Yield values that do not fit the joints."""
        for key in ("scale", "offset", "stiffness", "damping"):
            yield from per_joint_problems(key, getattr(self, key), joints)
        for index, row in enumerate(self.choices or ()):
            if (size := len(row) if isinstance(row, tuple) else 1) != len(joints):
                numbers = counted(size, "number")
                yield ("choices", index), f"has {numbers} for {counted(len(joints), 'joint')} ({', '.join(joints[:3])})"

    def output_problems(self, output: Tensor, size: int, joints: Sequence[str]) -> SpecProblems:
        """Yield the problem of an output whose size or type does not fit; `size`: its number of values."""
        what, count = f"the network's output '{output.name}'", len(joints)
        has = f"{what} has {counted(size, 'number')}"
        if self.choices is not None:
            if size not in (1, len(self.choices)):
                yield ("action", "choices"), f"{has}, for {len(self.choices)} choices: give a row for each number"
        elif output.type not in FLOATS:
            yield ("action",), f"{what} is of {output.type}; list what its numbers mean in 'choices'"
        elif self.execute is not None or self.ensemble is not None:
            if size % count or size // count < (self.execute or 1):
                needed = f"a multiple of {count} (joints)" + (
                    f", at least {self.execute} times" if self.execute else ""
                )
                yield ("action", "execute" if self.execute else "ensemble"), f"{has}, and not {needed}"
        elif size != count:
            chunk = f", or add 'execute' for {size // count} actions in turn" if size and size % count == 0 else ""
            names = ", ".join(joints[:20])
            needed = f"{counted(count, 'joint')}: {names}"
            yield ("action",), f"{has}, for {needed}; name those of the network in 'order'{chunk}"


class PolicyHistory(FrozenModel):
    """Past observations, which the network gets together with the present one; the newest is last."""

    frames: Annotated[int, Field(ge=2, le=1000, description="number of observations, with the present one")]
    order: Annotated[
        Literal["frame", "term"],
        Field(description="`frame`: observation after observation; `term`: for each term, its values over time"),
    ] = "frame"
    start: Annotated[
        Literal["repeat", "zeros"], Field(description="observations before the first: that one repeated, or zeros")
    ] = "repeat"


@dataclass(frozen=True, slots=True)
class Schedule:
    """The wanted velocity over time."""

    ends: tuple[float, ...]
    values: tuple[tuple[float, float, float], ...]

    @classmethod
    def of(cls, segments: Sequence[TwistSegment]) -> Schedule:
        """Return the schedule of segments, one after the other."""
        ends = accumulate(math.inf if segment.duration is None else segment.duration for segment in segments)
        return cls(tuple(ends), tuple((segment.linear, segment.lateral, segment.angular) for segment in segments))

    def at(self, time: float) -> tuple[float, float, float]:
        """Return vx, vy and wz at a time in s; 0 after the last segment."""
        now = time + _ROUNDING
        pairs = zip(self.ends, self.values, strict=True)
        return next((value for end, value in pairs if now < end), (0.0, 0.0, 0.0))


class Input:
    """The value of an input, made of the terms of the observation."""

    def __init__(  # noqa: PLR0917 - an input is all of these
        self,
        session: Session,
        name: str,
        terms: Sequence[Term],
        layout: Layout,
        schedule: Schedule,
        history: PolicyHistory | None,
    ) -> None:
        self._name, self._type = name, session.network.inputs[name].type
        self._shape, self._batch = session.shapes[name], session.batch
        self._terms = terms
        self._scales = [_scale(term, layout) for term in terms]
        self._readers: list[Reader | None] = [
            None if term.term == "last_action" else _reader(term, layout, schedule) for term in terms
        ]
        self._history = history
        self._frames = [term.frames or (history.frames if history else 1) for term in terms]
        self._by_term = any(term.frames for term in terms) or (history is not None and history.order == "term")
        self._past: deque[list[Vector]] = deque(maxlen=max(self._frames))

    def value(self, now: Observation, last_action: Vector) -> NDArray[Any]:
        """Return the value for this tick. Raises ScriptError."""
        frame = [self._part(index, now, last_action) for index in range(len(self._terms))]
        if not self._past:
            starts_empty = self._history is not None and self._history.start == "zeros"
            first = [np.zeros_like(part) for part in frame] if starts_empty else frame
            self._past.extend([first] * (max(self._frames) - 1))
        self._past.append(frame)
        frames = list(self._past)
        if self._by_term:
            parts = [
                (index, past_frame[index]) for index, most in enumerate(self._frames) for past_frame in frames[-most:]
            ]
        else:
            parts = [(index, part) for past_frame in frames for index, part in enumerate(past_frame)]
        flat = np.concatenate([part for _, part in parts])
        size = math.prod(self._shape)
        if flat.size not in (size, size // self._batch):
            sizes = ", ".join(f"{term.term} {part.size}" for term, part in zip(self._terms, frame, strict=True))
            mismatch = f"'{self._name}' takes {size} numbers, and the observation gives {flat.size}: {sizes}"
            raise ScriptError(f"the network's input {mismatch}")
        with np.errstate(over="ignore", invalid="ignore"):
            typed = flat.astype(self._type)
        if self._type not in FLOATS and not (typed == flat).all():
            index = self._index(parts, ~(typed == flat))
            raise ScriptError(
                f"the term '{self._terms[index].term}' has no whole numbers for '{self._name}', an input "
                f"of {self._type}"
            )
        if self._type in FLOATS and not np.isfinite(typed).all():
            # Each part is finite as float64.
            index = self._index(parts, ~np.isfinite(typed))
            value = float(flat[int(np.flatnonzero(~np.isfinite(typed))[0])])
            raise ScriptError(
                f"the term '{self._terms[index].term}' of the observation has the value {value:.4g}, which is "
                f"too large for {self._type}, the type of the network's input '{self._name}'; add 'clip'"
            )
        return np.ascontiguousarray(np.broadcast_to(typed, (size // flat.size, flat.size))).reshape(self._shape)

    @staticmethod
    def _index(parts: Sequence[tuple[int, Vector]], wrong: NDArray[np.bool_]) -> int:
        """Return the number of the term with the first wrong value."""
        ends = accumulate(part.size for _, part in parts)
        place = int(wrong.argmax())
        return next(index for (index, _), end in zip(parts, ends, strict=True) if place < end)

    def _part(self, index: int, now: Observation, last_action: Vector) -> Vector:
        term, read = self._terms[index], self._readers[index]
        value: Vector = last_action if read is None else np.asarray(read(now), dtype=np.float64)
        part: Vector = value * self._scales[index]
        if term.clip is not None:
            part = np.clip(part, -term.clip, term.clip)
        if not np.isfinite(part).all():
            raise ScriptError(f"the term '{term.term}' of the observation has a value that is not finite; add 'clip'")
        return part


def _scale(term: Term, layout: Layout) -> Any:
    if isinstance(term.scale, float | int):
        return float(term.scale)
    names = layout.of(term) if isinstance(term.scale, Mapping) else tuple(map(str, range(len(term.scale))))
    return np.asarray(values_of(term.scale, names, {}))


def _reader(term: Term, layout: Layout, schedule: Schedule) -> Reader:
    return (lambda now: schedule.at(now.time)) if term.term == "commands" else term.reader(layout)


@dataclass(slots=True)
class NetworkController:
    """A network with its inputs, the values it carries from one tick to the next, and its last action."""

    name: str
    session: Session
    inputs: Mapping[str, Input | PictureInput]
    fixed: dict[str, NDArray[Any]]  # name of an input -> its value, until `memory` changes it
    memory: Mapping[str, str]  # name of an input of a recurrent network -> output that sets it
    output: str
    spec: PolicyAction
    joints: Sequence[str]
    action: Any = field(init=False)  # the action of this tick, after `clip`; 0 before the first
    _chunks: deque[Any] = field(init=False)

    def __post_init__(self) -> None:
        self.action = np.zeros(len(self.joints))
        self._chunks = deque()

    def run(self, now: Observation) -> None:
        """Compute the next action. Raises ScriptError."""
        if self.spec.ensemble is not None:
            self._chunks = deque(chunk[1:] for chunk in self._chunks if len(chunk) > 1)
            self._chunks.append(self._asked(now))
            weights = np.exp(-self.spec.ensemble * np.arange(len(self._chunks)))
            action = weights @ np.array([chunk[0] for chunk in self._chunks]) / weights.sum()
        else:
            if not self._chunks:
                self._chunks.extend(self._asked(now)[: self.spec.execute])
            action = self._chunks.popleft()
        clip = self.spec.clip
        self.action = action if clip is None else np.clip(action, -clip, clip)

    def _asked(self, now: Observation) -> Vector:
        """Run the network and return its actions, one in each row."""
        inputs = {name: network_input.value(now, self.action) for name, network_input in self.inputs.items()}
        names = [self.output, *self.memory.values(), *self.session.hidden]
        try:
            result, *more = self.session.run({**self.fixed, **inputs}, names)
        except NetworkProblem as error:
            raise ScriptError(f"{self.name}: {error}") from None
        kept, hidden = more[: len(self.memory)], more[len(self.memory) :]
        for name, value in zip(self.session.hidden, hidden, strict=True):
            # Excluded choices have infinite scores.
            what = f"its inner value '{name}', which a maximum or comparison would hide"
            self._require_finite(np.where(np.isnan(value), value, 0), inputs, [what])
        for name, value in zip(self.memory.values(), kept, strict=True):
            self._require_finite(value, inputs, [f"the state '{name}'"])
        self.fixed.update(zip(self.memory, kept, strict=True))
        batch = self.session.batch
        row = result[0] if batch > 1 and result.shape[:1] == (batch,) else result
        values = np.asarray(row, dtype=np.float64).ravel()
        if self.spec.choices is None:
            self._require_finite(values, inputs, [f"joint '{joint}'" for joint in self.joints])
            return values.reshape(-1, len(self.joints))
        self._require_finite(values, inputs, [f"choice {place}" for place in range(values.size)])
        index = int(values.argmax()) if values.size > 1 else values[0]
        most = len(self.spec.choices) - 1
        if index != int(index) or not 0 <= index <= most:
            raise ScriptError(f"the network returned {index:g} as a choice; 'choices' has 0 to {most}")
        return np.array(self.spec.choices[int(index)], dtype=np.float64).reshape(1, -1)

    @staticmethod
    def _require_finite(values: NDArray[Any], inputs: Mapping[str, NDArray[Any]], names: Sequence[str]) -> None:
        """Raise ScriptError for a result that is not finite; `names`: of its values, one after the other."""
        wrong = ~np.isfinite(values.ravel())
        if wrong.any():
            largest = max((float(np.abs(tensor).max(initial=0.0)) for tensor in inputs.values()), default=0.0)
            place = int(wrong.argmax())
            raise ScriptError(
                f"the network returned {values.ravel()[place]} for {names[place % len(names)]}; its inputs are finite, "
                f"at most {largest:.4g}"
            )


_TARGETS: Final[Mapping[str, Callable[[dict[str, float]], JointTargets]]] = {
    "position": lambda values: JointTargets(position=values),
    "velocity": lambda values: JointTargets(velocity=values),
    "effort": lambda values: JointTargets(effort=values),
}


@dataclass(frozen=True, slots=True)
class Motors:
    """Turns the action into targets of the joints."""

    kind: str
    joints: tuple[str, ...]
    scale: Vector
    offset: Vector
    soft: bool  # True if a spring and a damper follow the target
    stiffness: Vector
    damping: Vector

    @classmethod
    def of(cls, action: PolicyAction, layout: Layout) -> Motors:
        """Return the motors of a policy."""

        def numbers(value: Any) -> Vector:
            return np.asarray(values_of(0.0 if value is None else value, layout.joints, layout.home))

        return cls(
            *(action.joints, layout.joints, numbers(action.scale), numbers(action.offset)),
            *(action.is_soft, numbers(action.stiffness), numbers(action.damping)),
        )

    def targets(self, action: Vector, now: Observation) -> JointTargets:
        """Return the targets of a tick. Raises ScriptError."""
        with np.errstate(over="ignore", invalid="ignore"):
            target = self.offset + self.scale * action
            if not self.soft:
                return _TARGETS[self.kind](self._finite(target, f"target {self.kind}"))
            states = [now.joints[name] for name in self.joints]
            position, velocity = (np.array([state[index] for state in states]) for index in (0, 1))
            if self.kind == "velocity":
                efforts = self.damping * (target - velocity)
            else:
                efforts = self.stiffness * (target - position) - self.damping * velocity
            return JointTargets(effort=self._finite(efforts, "effort"))

    def _finite(self, values: Vector, what: str) -> dict[str, float]:
        """Return the values by joint. Raises ScriptError for a value that is not finite."""
        by_joint = dict(zip(self.joints, values.tolist(), strict=True))
        if (joint := next((name for name, value in by_joint.items() if not math.isfinite(value)), None)) is not None:
            raise ScriptError(
                f"the {what} of joint '{joint}' is {by_joint[joint]}: the network's output is finite, so lower "
                "'scale', or add 'clip' to the action"
            )
        return by_joint
