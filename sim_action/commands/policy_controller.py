"""The controller of a policy: observations into the network, its output into targets of the joints."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from sim_action.commands.onnx_network import NetworkProblem, Session, Tensor
from sim_action.commands.policy_terms import Layout, Offset, PerJoint, Reader, Term, values_of
from sim_action.commands.twist import TwistSegment
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import FrozenModel
from sim_action.core.records import dataclass, field
from sim_action.state.command import JointTargets

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.observation import Observation

    Vector = NDArray[np.float64]


_ROUNDING: Final = 1e-9
"""Sim time is step / rate, so equal times may differ by rounding."""


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
        Offset,
        Field(description="added after `scale`: rad (m), or `home`, the positions at which the robot starts"),
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
        ends = accumulate(math.inf if each.duration is None else each.duration for each in segments)
        return cls(tuple(ends), tuple((each.linear, each.lateral, each.angular) for each in segments))

    def at(self, time: float) -> tuple[float, float, float]:
        """Return vx, vy and wz at a time in s; 0 after the last segment."""
        now = time + _ROUNDING
        pairs = zip(self.ends, self.values, strict=True)
        return next((value for end, value in pairs if now < end), (0.0, 0.0, 0.0))


class Input:
    """The value of an input, made of the terms of the observation."""

    def __init__(
        self, tensor: Tensor, terms: Sequence[Term], layout: Layout, wanted: Schedule, history: PolicyHistory | None
    ) -> None:
        self.tensor = tensor
        self._terms = terms
        self._scales = [_scale(term, layout) for term in terms]
        self._readers: list[Reader | None] = [
            None if term.term == "last_action" else _reader(term, layout, wanted) for term in terms
        ]
        self._history = history
        self._past: deque[list[Vector]] = deque(maxlen=history.frames if history else 1)

    def value(self, now: Observation, last_action: Vector) -> NDArray[Any]:
        """Return the value for this tick. Raises ScriptError."""
        import numpy as np

        frame = [self._part(index, now, last_action) for index in range(len(self._terms))]
        if self._history is not None and not self._past:
            first = frame if self._history.start == "repeat" else [np.zeros_like(part) for part in frame]
            self._past.extend([first] * (self._history.frames - 1))
        self._past.append(frame)
        frames = list(self._past)
        if self._history is not None and self._history.order == "term":
            parts = [each[index] for index in range(len(frame)) for each in frames]
        else:
            parts = [part for each in frames for part in each]
        flat = np.concatenate(parts)
        size = self.tensor.size
        if size is not None and flat.size != size:
            sizes = ", ".join(f"{term.term} {part.size}" for term, part in zip(self._terms, frame, strict=True))
            found = f"'{self.tensor.name}' has {size} numbers, the observation gives {flat.size}: {sizes}"
            raise ScriptError(f"the network's input {found}")
        with np.errstate(over="ignore"):
            value = flat.reshape(self.tensor.shape_for(flat.size)).astype(self.tensor.type)
        if not np.isfinite(value).all():
            # Each part is finite as float64.
            ends, place = np.cumsum([part.size for part in parts]), int(np.flatnonzero(~np.isfinite(value.ravel()))[0])
            part = parts[int(np.searchsorted(ends, place, side="right"))]
            index = next(number for each in frames for number, one in enumerate(each) if one is part)
            raise ScriptError(
                f"the term '{self._terms[index].term}' of the observation has the value {flat[place]:.4g}, which is "
                f"too large for {self.tensor.type}, the type of the network's input '{self.tensor.name}'; add 'clip'"
            )
        return value

    def _part(self, index: int, now: Observation, last_action: Vector) -> Vector:
        import numpy as np

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
    import numpy as np

    names = layout.of(term) if isinstance(term.scale, Mapping) else tuple(map(str, range(len(term.scale))))
    return np.asarray(values_of(term.scale, names, {}))


def _reader(term: Term, layout: Layout, wanted: Schedule) -> Reader:
    return (lambda now: wanted.at(now.time)) if term.term == "commands" else term.reader(layout)


@dataclass(slots=True)
class Memory:
    """The values that a recurrent network carries from one tick to the next.

    Attributes:
        sources: name of each input -> output that sets it.
    """

    sources: Mapping[str, str]
    values: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, tensors: Mapping[Tensor, str]) -> Memory:
        """Return the memory of inputs with the outputs that set them; all values are 0."""
        import numpy as np

        zeros = {
            each.name: np.zeros([1 if size is None else size for size in each.shape], each.type) for each in tensors
        }
        return cls({each.name: source for each, source in tensors.items()}, zeros)


@dataclass(slots=True)
class NetworkController:
    """A network with its inputs, and its last action."""

    name: str
    session: Session
    inputs: Sequence[Input]
    memory: Memory
    output: str
    layout: Layout
    clip: float | None
    action: Any = field(init=False)

    def __post_init__(self) -> None:
        import numpy as np

        self.action = np.zeros(self.layout.actions)

    def run(self, now: Observation) -> None:
        """Compute the next action. Raises ScriptError."""
        import numpy as np

        values = {each.tensor.name: each.value(now, self.action) for each in self.inputs}
        names = list(self.memory.sources)
        outputs = [self.output, *(self.memory.sources[name] for name in names)]
        try:
            found, *kept = self.session.run({**values, **self.memory.values}, outputs)
        except NetworkProblem as error:
            raise ScriptError(f"{self.name}: {error}") from None
        action = found.ravel()
        if action.size != self.layout.actions:
            raise ScriptError(
                f"the network's output '{self.output}' has {action.size} numbers, for {self.layout.actions} joints"
            )
        if not np.isfinite(action).all():
            joint = self.layout.joints[int(np.flatnonzero(~np.isfinite(action))[0])]
            largest = max(float(np.abs(value).max(initial=0.0)) for value in values.values())
            raise ScriptError(
                f"the network returned {action[~np.isfinite(action)][0]} for joint '{joint}'; its inputs are finite, "
                f"at most {largest:.4g}"
            )
        for name, value in zip(names, kept, strict=True):
            self.memory.values[name] = value.astype(self.memory.values[name].dtype)
        self.action = action if self.clip is None else np.clip(action, -self.clip, self.clip)


_TARGETS: Final[Mapping[str, Callable[[dict[str, float]], JointTargets]]] = {
    "position": lambda values: JointTargets(position=values),
    "velocity": lambda values: JointTargets(velocity=values),
    "effort": lambda values: JointTargets(effort=values),
}


@dataclass(frozen=True, slots=True)
class Motors:
    """Turns the action into targets of the joints.

    Attributes:
        soft: True if a spring and a damper follow the target.
    """

    kind: str
    joints: tuple[str, ...]
    scale: Vector
    offset: Vector
    soft: bool
    stiffness: Vector
    damping: Vector

    @classmethod
    def of(cls, action: PolicyAction, layout: Layout) -> Motors:
        """Return the motors of a policy."""
        import numpy as np

        def numbers(value: Any) -> Vector:
            return np.asarray(values_of(0.0 if value is None else value, layout.joints, layout.home))

        soft = action.stiffness is not None or action.damping is not None
        return cls(
            *(action.joints, layout.joints, numbers(action.scale), numbers(action.offset)),
            *(soft, numbers(action.stiffness), numbers(action.damping)),
        )

    def targets(self, action: Vector, now: Observation) -> JointTargets:
        """Return the targets of a tick. Raises ScriptError."""
        import numpy as np

        with np.errstate(over="ignore", invalid="ignore"):
            return self._targets(action, now)

    def _targets(self, action: Vector, now: Observation) -> JointTargets:
        import numpy as np

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
        found = dict(zip(self.joints, values.tolist(), strict=True))
        if (joint := next((name for name, value in found.items() if not math.isfinite(value)), None)) is not None:
            raise ScriptError(
                f"the {what} of joint '{joint}' is {found[joint]}: the network's output is finite, so lower 'scale', "
                "or add 'clip' to the action"
            )
        return found
