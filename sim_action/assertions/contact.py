"""`contact: {with: ball, link: hand, at_most: 20 N}`: the robot touches a body."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import check_order
from sim_action.assertions.monitors.goals import Goal, HoldTime, Invariant, joined
from sim_action.assertions.monitors.proximity import forces, least_so_far, nearest_of, touching_at, with_zeros
from sim_action.core import units
from sim_action.core.field_types import PositiveNewtons, PositiveSeconds
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.ground import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.observation import Contact, Observation
    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.trace_records import Nearness


_PATTERN: Final = re.compile(r"[*?\[]")

# In MuJoCo, a body that is pushed loses contact for up to five steps at a time.
_MAX_CONTACT_GAP_S: Final = 0.05


class Touch(Assertion):
    """The robot touches the body that `with` names. If `at_most` is given, the contact force also never exceeds it.

    Touching is a goal, `at_most` an invariant. The force is the sum over all contact points of the two in one physics
    step. An impact lasts only a few steps, so
    its force is large. A body that is pushed bounces: a loss of contact for 50 ms or less does not interrupt the
    contact.
    """

    key: ClassVar[str] = "contact"

    body: Annotated[str, Field(alias="with", min_length=1, description="name of the object")]
    link: Annotated[
        str | None, Field(min_length=1, description="link of the robot, or a pattern such as '*_finger'; default: any")
    ] = None
    at_least: Annotated[PositiveNewtons | None, Field(description="a goal: smaller forces do not count")] = None
    at_most: Annotated[PositiveNewtons | None, Field(description="an invariant: must not be exceeded")] = None
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="required duration; default: one physics step")
    ] = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        check_order(self.at_least, self.at_most, "N")
        return self

    @property
    def watch(self) -> ClearanceWatch | None:
        """The distances that are recorded in case of no contact; None for a pattern of links."""
        if self.link is not None and _PATTERN.search(self.link):
            return None
        return ClearanceWatch(None if self.link is None else (self.link,), (self.body,))

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(contacts=True, clearances=frozenset() if self.watch is None else frozenset({self.watch}))

    @property
    def hold_time(self) -> float | None:
        """See Assertion.hold_time."""
        return self.span

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal."""
        return True

    @property
    def has_truth(self) -> bool:
        """See Assertion.has_truth."""
        return True

    @property
    def title(self) -> str:
        """See Assertion.title."""
        by = "" if self.link is None else f" of {self.link}"
        limits = (("at least", self.at_least, "N"), ("at most", self.at_most, "N"), ("for", self.span, "s"))
        asked = (f"{word} {units.display(value, unit)}" for word, value, unit in limits if value is not None)
        return f"contact{by} with {self.body} {', '.join(asked)}".rstrip()

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield a body or a link that does not exist."""
        bodies = [body.name for body in scene.world.objects]
        if self.body == GROUND:
            yield ("with",), "contacts with the ground are not recorded; name an object"
        elif self.body not in bodies:
            yield ("with",), f"the world has no body '{self.body}'{did_you_mean(self.body, bodies)}"
        # Only the engine knows the shapes of an MJCF model.
        links = [link.name for link in scene.model.links if link.collisions or scene.model.mjcf]
        if self.link is not None and not any(self._is_of(link) for link in links):
            yield (
                ("link",),
                f"the robot has no link '{self.link}' with a collision shape{did_you_mean(self.link, links)}",
            )

    def _is_of(self, link: str) -> bool:
        return self.link is None or link == self.link or fnmatchcase(link, self.link)

    def is_meant(self, contact: Contact) -> bool:
        """Return True if the contact is between the named link and body."""
        return contact.body == self.body and self._is_of(contact.link)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return TouchMonitor(self, 1 / scene.physics.rate, HoldTime(self.span or 0.0))


@dataclass(frozen=True, slots=True)
class TouchMonitor:
    """The fold of the contact force over all steps with a contact; a stored trace may have fewer steps than contacts.

    Attributes:
        step: duration of a physics step in s of sim time.
        force: the fold against `at_least`, or against 0 N.
        limit: the fold against `at_most`.
        touches: True if there was any contact.
        last: sim time in s of the last contact that is strong enough.
        nearest: the least distance.
        instead: another contact: of the body with another link if there is one, else the first of all.
        end: sim time of the last step, in s.
    """

    is_momentary: ClassVar[bool] = False

    spec: Touch
    step: float
    stretch: HoldTime
    force: Goal = Goal()
    limit: Invariant = Invariant()
    touches: bool = False
    last: float | None = None
    nearest: Nearness | None = None
    instead: Contact | None = None
    end: float | None = None

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return joined(self.limit.state, self.stretch.state)

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided. A contact decides, unless there is a force limit."""
        return self.state is State.BROKEN or (self.state is State.HOLDS and self.spec.at_most is None)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        time, force = forces(filter(self.spec.is_meant, trace.contacts))
        others = [contact for contact in trace.contacts if not self.spec.is_meant(contact)]
        end = float(trace.time[-1]) if len(trace) else self.end
        nearest = nearest_of(trace, self.spec.watch, self.nearest)
        seen = replace(self, end=end, instead=self._instead_of(others), nearest=nearest)
        return seen.touched(time, force) if len(time) else seen

    def _instead_of(self, others: list[Contact]) -> Contact | None:
        """Return the contact to name in the message if the expected one is missing."""
        known = others if self.instead is None else [self.instead, *others]
        of_body = (contact for contact in known if contact.body == self.spec.body)
        return next(of_body, next(iter(known), None))

    def touched(self, time: FloatArray, force: FloatArray) -> Self:
        """Return the fold after these steps with a contact, (N,) s and (N,) N."""
        enough = force - (self.spec.at_least or 0.0)
        limit = self.limit if self.spec.at_most is None else self.limit.observe(time, self.spec.at_most - force)
        seen = replace(self, force=self.force.observe(time, enough), limit=limit, touches=True)
        strong = time[enough >= 0]
        return seen.lasted(strong) if len(strong) else seen

    def lasted(self, time: FloatArray) -> Self:
        """Return the fold after these steps with a contact that is strong enough, (N,) s."""
        return replace(self, stretch=self.stretch.observe(*self._touching(time)), last=float(time[-1]))

    def _touching(self, time: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return times in s and True for contact: all of `time`, and False one step before each new contact."""
        import numpy as np

        longest = max(_MAX_CONTACT_GAP_S, 1.5 * self.step)
        begins = np.flatnonzero(np.diff(time, prepend=-np.inf if self.last is None else self.last) > longest)
        # `time` has no steps without contact: insert one before each new contact.
        moments = np.insert(time, begins, time[begins] - self.step)
        return moments, np.insert(np.ones(len(time), dtype=bool), begins, np.zeros(len(begins), dtype=bool))

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth. It is true at each step with a contact whose force is within the bounds."""
        time, force = forces(filter(self.spec.is_meant, trace.contacts))
        strong = force - (self.spec.at_least or 0.0) >= 0
        if self.spec.at_most is not None:
            strong &= self.spec.at_most - force >= 0
        return touching_at(trace, time[strong], self.step)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals. Returns duration, force, contact (0 or 1) and least distance."""
        import numpy as np

        spec, body = self.spec, self.spec.body
        time, force = forces(filter(spec.is_meant, trace.contacts))
        pressed, touches = (with_zeros(trace.time, time, values, self.step) for values in (force, np.ones(len(time))))
        pressing = Signal(f"force on {body}", "N", *pressed, spec.at_least, spec.at_most)
        touching = Signal(f"touching {body}", "contacts", *touches, lower=1.0)
        asked = (
            [] if spec.span is None else [self._lasting_curve(trace, time[force >= (spec.at_least or 0.0)], spec.span)]
        )
        asked += [pressing, touching] if spec.at_least or spec.at_most else [touching, pressing]
        return (*asked, *self._nearness(trace))

    def _lasting_curve(self, trace: Trace, time: FloatArray, span: float) -> Signal:
        moments, holds = self._touching(time) if len(time) else (trace.time, trace.time < 0)
        lasted = self.stretch.lasting(moments, holds)
        return Signal(f"time touching {self.spec.body}", "s", moments, lasted, lower=span)

    def _nearness(self, trace: Trace) -> Iterator[Signal]:
        time, distance = (None, None) if self.spec.watch is None else least_so_far(trace, self.spec.watch)
        if time is not None and distance is not None and len(time):
            yield Signal(f"least distance to {self.spec.body}", "m", time, distance)

    def verdict(self) -> Verdict:
        """Return the verdict on an exceeded force, else on a missing requirement, else on the strictest one."""
        spec, passed = self.spec, self.state is State.HOLDS
        if self.limit.state is State.BROKEN or (passed and spec.at_least is None and spec.span is None):
            return self._at_most() if spec.at_most is not None else self._counted()
        if spec.span is not None and self.force.state is State.HOLDS:
            return self._lasting(spec.span)
        return self._counted() if spec.at_least is None or not self.touches else self._at_least(spec.at_least)

    def _counted(self) -> Verdict:
        if self.end is None and not self.touches:
            return Verdict(False, None, 1.0, None, "contacts", None, "no physics step to measure")
        if not self.touches:
            message = f"did not touch {self.spec.body} in {self.end:.1f} s; {self._near()}{self._instead()}"
            return Verdict(False, 0.0, 1.0, -1.0, "contacts", self.end, message)
        message = f"touched {self.spec.body} at {self.force.time:.2f} s, with {units.display(self._met(0.0), 'N')}"
        return Verdict(True, 1.0, 1.0, 0.0, "contacts", self.force.time, message)

    def _at_least(self, limit: float) -> Verdict:
        passed, force = self.force.state is State.HOLDS, self._met(limit)
        found, wanted = units.display_apart(force, limit, "N")
        message = f"touched {self.spec.body} with {found}{'' if passed else f' of {wanted}'} at {self.force.time:.2f} s"
        return Verdict(passed, force, limit, self.force.margin, "N", self.force.time, message)

    def _at_most(self) -> Verdict:
        limit, passed = self.spec.at_most or 0.0, self.limit.state is State.HOLDS
        force = limit - (self.limit.margin or 0.0)
        found, allowed = units.display_apart(force, limit, "N")
        bound = f", {'limit' if passed else 'more than'} {allowed}"
        message = (
            f"touched {self.spec.body} with {'at most ' if passed else ''}{found} at {self.limit.time:.2f} s{bound}"
        )
        return Verdict(passed, force, limit, self.limit.margin, "N", self.limit.time, message)

    def _lasting(self, span: float) -> Verdict:
        touch = self.stretch
        lasted, wanted = units.display_apart(touch.longest, span, "s")
        how_long = lasted if touch.state is State.HOLDS else f"{lasted} of {wanted}"
        message = f"touched {self.spec.body} for {how_long}, from {touch.began:.2f} s on"
        passed, margin = touch.state is State.HOLDS, touch.longest - span
        return Verdict(passed, touch.longest, span, margin, "s", touch.goal.time, message)

    def _met(self, limit: float) -> float:
        return limit + (self.force.margin or 0.0)

    def _near(self) -> str:
        if self.nearest is None:
            return ""
        return f"came within {units.display(self.nearest.distance, 'm')} at {self.nearest.time:.2f} s; "

    def _instead(self) -> str:
        other = self.instead
        if other is None:
            return "touched nothing else"
        if other.body == self.spec.body:
            return f"{other.link} touched it at {other.time:.2f} s"
        return f"{other.link} touched {other.body} at {other.time:.2f} s"
