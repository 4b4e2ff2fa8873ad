"""`any_of`, `all_of`, `at_once` and `not`: assertions that consist of other assertions."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.temporal_logic import quoted
from sim_action.assertions.temporal_logic.combination import AtOnceMonitor, Combination, NegationMonitor
from sim_action.assertions.temporal_logic.formula import And, Not, Or
from sim_action.core.records import delegated
from sim_action.core.wording import shown
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import KeyPath, SpecProblems
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Mark, Signal
from sim_action.world.claims import ClaimFinding, Findings
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.assertions.temporal_logic.formula import Formula


def formula_of(assertion: Assertion, scene: Scene) -> Formula:
    """Return an assertion as a formula; one without a meaning is a signal of its own, which is positive or not."""
    from sim_action.assertions.temporal_logic.parser import parse  # `validate` does without it

    if isinstance(assertion, Joined | Negation):
        return assertion.as_formula(scene)
    return parse(assertion.meaning(scene) or f"{quoted(repr(assertion))}.x > 0")


class Combined(Assertion):
    """The base class of assertions whose YAML value is one assertion or several."""

    @classmethod
    @abstractmethod
    def entries(cls, data: Any) -> Sequence[tuple[KeyPath, Any]]:
        """Return each assertion in the YAML value with its keys. Raises ValueError for another kind of value."""

    @classmethod
    @abstractmethod
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        """Return the spec made of the assertions that were read from `entries`."""

    @classmethod
    @abstractmethod
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of the YAML value, given the schema of a part."""

    @property
    @abstractmethod
    def placed_parts(self) -> Sequence[tuple[KeyPath, Assertion]]:
        """The parts with the keys that lead to each."""

    @override
    def placed_leaves(self) -> Iterator[tuple[KeyPath, Assertion]]:
        for place, part in self.placed_parts:
            yield from (((self.key, *place, *path), leaf) for path, leaf in part.placed_leaves())

    @override
    def negated_leaves(self) -> Iterator[Assertion]:
        for _, part in self.placed_parts:
            yield from part.negated_leaves()

    @override
    def combined_claims(self, scene: Scene) -> Findings:
        """Yield combinations that hold, or fail, in every run: a check and its opposite, or a limit beyond any run."""
        from sim_action.assertions.temporal_logic.formula_claims import constant_result  # `validate` does without it

        inner = [finding.below(place) for place, part in self.placed_parts for finding in part.combined_claims(scene)]
        yield from (finding.below((self.key,)) for finding in inner)
        result = None if inner else constant_result(formula_of(self, scene), scene)
        if result is not None:
            always = "holds" if result else "fails"
            message = f"this {always} in every run, whatever the robot does: its limits exclude or contain each other"
            use = "or no run comes to them; remove a part, or change a limit"
            yield ClaimFinding("unreachable-limit", (self.key,), f"{message}, {use}")

    @property
    @override
    def channels(self) -> Channels:
        return Channels.all_of(part.channels for _, part in self.placed_parts)

    @property
    @override
    def truth_channels(self) -> Channels:
        return Channels.all_of(part.truth_channels for _, part in self.placed_parts)

    @property
    @override
    def is_goal(self) -> bool:
        return any(part.is_goal for _, part in self.placed_parts)

    @property
    @override
    def horizon(self) -> float:
        return max(part.horizon for _, part in self.placed_parts)

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return the signals of all parts."""
        parts = (part for _, part in self.placed_parts)
        return tuple(signal for part in parts for signal in part.signals(scene, start, trace, after, before))

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Return the marks of all parts."""
        return tuple(mark for _, part in self.placed_parts for mark in part.marks(scene, start))

    def _below(self, problems: Callable[[Assertion], SpecProblems]) -> SpecProblems:
        """Yield the problems of all parts, each with its place."""
        for place, part in self.placed_parts:
            yield from (((*place, part.key, *path), message) for path, message in problems(part))

    @override
    def problems(self, scene: Scene) -> SpecProblems:
        yield from self._below(lambda part: part.problems(scene))

    @override
    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        yield from self._below(lambda part: part.sensor_problems(kinds))

    @override
    def file_problems(self, workspace: Workspace) -> SpecProblems:
        yield from self._below(lambda part: part.file_problems(workspace))


class Several(Combined):
    """The base class of `any_of`, `all_of` and `at_once`."""

    parts: Annotated[tuple[Assertion, ...], Field(min_length=1, description="the list, which is the whole value")]

    @classmethod
    @override
    def entries(cls, data: Any) -> Sequence[tuple[KeyPath, Any]]:
        if not isinstance(data, tuple) or not data:
            raise ValueError(f"expected a list of assertions, each starting with '- ', found {shown(data)}")
        return [((index,), entry) for index, entry in enumerate(data)]

    @classmethod
    @override
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        return cls(parts=parts)

    @classmethod
    @override
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        return {"type": "array", "minItems": 1, "items": part}

    @property
    @override
    def placed_parts(self) -> Sequence[tuple[KeyPath, Assertion]]:
        return [((index,), part) for index, part in enumerate(self.parts)]

    @property
    @override
    def title(self) -> str:
        return shortened_title(f"{self.key}: {'; '.join(part.inner_title for part in self.parts)}")

    @property
    def inner_title(self) -> str:
        """The title in parentheses, so that the next part is not read as one of this list."""
        return f"({self.title})"


class Joined(Several):
    """The base class of `any_of` and `all_of`, which join the results of their parts."""

    every: ClassVar[bool]  # True if all parts must hold, False if one is enough

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        return self._combination(tuple(part.started(scene, start) for part in self.parts))

    def opened(self, scene: Scene, start: Observation, span: float | None = None) -> Monitor:
        """See Assertion.opened. Each part must become true by itself."""
        if span is not None:
            return super().opened(scene, start, span)
        return self._combination(tuple(part.opened(scene, start) for part in self.parts))

    def as_formula(self, scene: Scene) -> Formula:
        """Return the assertion as a formula made of its parts' formulas."""
        parts = tuple(formula_of(part, scene) for part in self.parts)
        return parts[0] if len(parts) == 1 else And(parts) if self.every else Or(parts)

    def _combination(self, monitors: tuple[Monitor, ...]) -> Combination:
        remembers = self.has_truth and any(monitor.is_sampled for monitor in monitors)
        titles = (part.inner_title for part in self.parts)
        return Combination.of(titles, monitors, remembers=remembers, every=self.every)


class AllOf(Joined):
    """Each assertion of a list holds, not necessarily at the same moment.

    `expect` itself asks the same of its entries; for goals that must be true at one moment, see `at_once`. `all_of` is
    useful inside `any_of` and `not`, and to give several assertions one `name`, `after`, `before` and `severity`. It is
    a goal if one of its parts is a goal, and breaks as soon as one part breaks. The part that decides, which the
    message names, is the one with the smallest margin if all have one unit, else the last that came true or the first
    that failed.
    """

    key: ClassVar[str] = "all_of"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "goal if one of its assertions is a goal, else invariant",
        "Each part passed, at the same moment or at different ones.",
        "A part failed.",
        "No part failed, and a part was never judged.",
    )
    every: ClassVar[bool] = True


class AnyOf(Joined):
    """At least one assertion of a list holds.

    It is a goal if one of its parts is a goal: the run waits until a goal comes true. If none does, a part that is not
    broken at the end of the run holds. Otherwise it is an invariant that breaks with its last part. Margin, limit and
    time come from the deciding part, which the message names: of the parts that hold (or of all), the one with the
    greatest margin if their units are equal, else the first. `after`, `before`, `name` and `severity` are written next
    to `any_of`.
    """

    key: ClassVar[str] = "any_of"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "goal if one of its assertions is a goal, else invariant",
        "At least one part passed. A part that passes in every run hides the others.",
        "Every part failed.",
        "No part passed, and a part was never judged.",
    )
    every: ClassVar[bool] = False
    word: ClassVar[str] = "or"

    @property
    @override
    def has_truth(self) -> bool:
        return all(part.has_truth for part in self.parts)


class AtOnce(Several):
    """All assertions of a list are true at one moment.

    It is a goal. Each part is judged at each moment by itself: a goal such as `reach` is true while the robot is there,
    an invariant such as `upright` is true while it is not broken, `settled` while the robot is at rest, and a sensor's
    reading counts until the next one. An assertion that has no truth at a moment, such as `final_pose`, is refused.
    """

    key: ClassVar[str] = "at_once"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "goal",
        "All parts were true at one moment, after a moment at which one was false.",
        "The parts were never true together, or only from t = 0 on.",
    )

    is_goal: ClassVar[bool] = True
    has_truth: ClassVar[bool] = True

    channels: ClassVar[Channels] = delegated("truth_channels")

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield the problems of all parts, and parts that have no truth at a moment."""
        yield from super().problems(scene)
        for place, part in self.placed_parts:
            if not part.has_truth:
                yield place, f"'{part.key}' is not true or false at a moment; use all_of, or another assertion"

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return the number of conditions that are true, and the signals of all parts."""
        counts = Window(self.monitor(scene, start), after, before).signals(trace)
        return (*counts, *super().signals(scene, start, trace, after, before))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        monitors = tuple(part.started(scene, start) for part in self.parts)
        return AtOnceMonitor.of((part.inner_title for part in self.parts), monitors, remembers=True)


class Negation(Combined):
    """An assertion does not hold.

    The negation of a goal is an invariant: `not: {reach: ...}` keeps the robot away and breaks when the goal comes
    true. The negation of an invariant is a goal: `not: no_collision` asks for a collision and comes true when the
    invariant breaks. An assertion that is both goal and invariant is judged at the end of the run. The margin is the
    inner assertion's with the opposite sign. For a count of contacts, the limit is the other count, 0 or 1.
    """

    key: ClassVar[str] = "not"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "invariant if its assertion is a goal, and the other way round",
        "The part failed.",
        "The part passed.",
        "The part was never judged.",
    )

    part: Annotated[Assertion, Field(description="the assertion, which is the whole value")]

    @classmethod
    @override
    def entries(cls, data: Any) -> Sequence[tuple[KeyPath, Any]]:
        return [((), data)]

    @classmethod
    @override
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        (part,) = parts
        return cls(part=part)

    @classmethod
    @override
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        return part

    @property
    @override
    def placed_parts(self) -> Sequence[tuple[KeyPath, Assertion]]:
        return [((), self.part)]

    @override
    def negated_leaves(self) -> Iterator[Assertion]:
        twice = list(self.part.negated_leaves())
        yield from (leaf for leaf in self.part.leaves() if all(leaf is not other for other in twice))

    def as_formula(self, scene: Scene) -> Formula:
        """Return the assertion as the negated formula of its part."""
        return Not(formula_of(self.part, scene))

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal. The negation of a goal is an invariant, and the other way round."""
        return not self.part.is_goal

    has_truth: ClassVar[bool] = delegated("part.has_truth")

    @property
    @override
    def channels(self) -> Channels:
        return self.part.channels | self.part.truth_channels

    @property
    @override
    def title(self) -> str:
        part = self.part
        return shortened_title(f"not ({part.title})" if isinstance(part, Negation) else f"not {part.inner_title}")

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return the signals of the part, with inverted limits."""
        return tuple(signal.contrary() for signal in super().signals(scene, start, trace, after, before))

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor. A double negation is the inner assertion itself."""
        if isinstance(self.part, Negation):
            return self.part.part.started(scene, start)
        monitor = self.part.started(scene, start)
        return NegationMonitor(monitor, monitor.state)
