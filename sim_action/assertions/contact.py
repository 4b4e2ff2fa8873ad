"""`contact: {with: ball, link: hand, at_most: 20 N}`: the robot touches a body."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import FORCE_WINDOW_S, Monitor, State, Truth, contacts
from sim_action.assertions.monitors.bounds import Bounds, bounds_title, check_bounds, check_order, joined
from sim_action.assertions.monitors.contacts import Forces, MeanForce, duration_text, times_of
from sim_action.assertions.monitors.windows import HoldTime
from sim_action.core import units
from sim_action.core.field_types import FrozenModel, PositiveNewtons, PositiveNewtonSeconds, PositiveSeconds
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import STEP_EPSILON
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import links_with_shapes, matches_name
from sim_action.state.observation import Contact, Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceWatch, Nearness
from sim_action.state.verdict import Signal, Verdict
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.physics import GROUND
from sim_action.world.scene import Scene

_PATTERN: Final = re.compile(r"[*?\[]")


class ImpulseLimits(FrozenModel):
    """Limits of the impulse of a contact: its mean force over the time `window`, times that time."""

    at_least: Annotated[PositiveNewtonSeconds | None, Field(description="a goal: smaller impulses do not count")] = None
    at_most: Annotated[
        PositiveNewtonSeconds | None, Field(description="an invariant: must not be exceeded in any `window`")
    ] = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        check_bounds(self.at_least, self.at_most, "N s")
        return self


class Touch(Assertion):
    """The robot touches the body that `with` names, or a limit says how hard it may touch the body.

    A touch is a goal, also with `at_least` or `for`. `at_most` is an invariant; alone, it does not demand a touch. To
    demand one as well, add `contact: {with: ball}` to `expect`. A contact between a fixed base and a body on a path has
    no force and meets no limit.

    The force is the sum over all contact points, averaged over the last `window`, which may reach back to before
    `after`. The impulse is the mean force times `window`: the momentum that passes in this time. A loss of contact for
    50 ms or less does not interrupt a contact without `at_least`.
    """

    key: ClassVar[str] = "contact"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "goal; `at_most` alone: invariant",
        "The robot touched the body for the time `for`, with at least `at_least`, and never with more than "
        "`at_most`. With `at_most` alone: no mean force or impulse exceeded it. If the robot never touched "
        "the body, the [audit of claims](claims.md) adds a warning.",
        "The robot never touched the body so long or so strongly, or a mean force or impulse exceeded `at_most`.",
    )
    sees_shapes: ClassVar[bool] = True
    bare_value: ClassVar[str | None] = "with"

    body: Annotated[
        str, Field(alias="with", min_length=1, description="name of the object, or ground; may be the whole value")
    ]
    link: Annotated[
        str | None, Field(min_length=1, description="link of the robot, or a pattern such as '*_finger'; default: any")
    ] = None
    at_least: Annotated[PositiveNewtons | None, Field(description="a goal: smaller mean forces do not count")] = None
    at_most: Annotated[PositiveNewtons | None, Field(description="an invariant: the mean force must not exceed it")] = (
        None
    )
    impulse: Annotated[
        ImpulseLimits | None, Field(description="`at_least`, `at_most` or both: limits of the impulse in N s")
    ] = None
    window: Annotated[
        PositiveSeconds, Field(le=10, description="time over which the force is averaged; at least one physics step")
    ] = FORCE_WINDOW_S
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="required duration; default: one physics step")
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _takes_text_alone(cls, data: Any) -> Any:
        return {"with": data} if isinstance(data, str) else data

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        check_order(self.at_least, self.at_most, "N")
        return self

    @property
    @override
    def names_links(self) -> bool:
        return self.link is not None

    @override
    def meaning(self, scene: Scene) -> str:
        plain = self.link is None and self.span is None and not self.has_least and not self.has_most
        return f"eventually ({contacts.clearance_signal(self.body)} <= 0)" if plain else ""

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        weak = not self.is_goal and run.verdict.passed and run.verdict.measured == 0
        none = run.is_negated and self.has_least and not any(map(self.is_meant, run.trace.contacts))
        if weak or none:
            message = f"the robot never pressed against {self.body}, so the limit was compared with 0 only"
            use = f"let it touch {self.body}, or use no_collision if it must not"
            yield ClaimFinding("never-touched", (), f"{message}; {use}")

    @property
    def impulse_limits(self) -> tuple[float | None, float | None]:
        """The limits `at_least` and `at_most` of the impulse in N s; None where there is none."""
        return (None, None) if self.impulse is None else (self.impulse.at_least, self.impulse.at_most)

    @property
    def has_least(self) -> bool:
        """True if weaker contacts do not count."""
        return self.at_least is not None or self.impulse_limits[0] is not None

    @property
    def has_most(self) -> bool:
        """True if a contact may be too strong."""
        return self.at_most is not None or self.impulse_limits[1] is not None

    @property
    def watch(self) -> ClearanceWatch | None:
        """The distances that are recorded in case of no contact; None for a pattern of links."""
        if self.link is not None and _PATTERN.search(self.link):
            return None
        return ClearanceWatch(None if self.link is None else (self.link,), (self.body,))

    @property
    @override
    def channels(self) -> Channels:
        watches = frozenset() if self.watch is None else frozenset({self.watch})
        return Channels(contacts=True, clearances=watches, ground=self.body == GROUND)

    hold_time: ClassVar[float | None] = delegated("span")

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal. An upper limit alone does not demand a touch."""
        return self.has_least or self.span is not None or not self.has_most

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        by = "" if self.link is None else f" of {self.link}"
        asked = []
        if self.at_least is not None or self.at_most is not None:
            asked.append(f"{bounds_title(self.at_least, self.at_most, 'N')} over {duration_text(self.window)}")
        if self.impulse is not None:
            asked.append(f"impulse {bounds_title(*self.impulse_limits, 'N s')} within {duration_text(self.window)}")
        if self.span is not None:
            asked.append(f"for {units.display(self.span, 's')}")
        return f"contact{by} with {self.body} {', '.join(asked)}".rstrip()

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield a body or a link that does not exist, limits without a force, and a window without a whole step."""
        bodies = scene.world.names
        if self.body not in (*bodies, GROUND):
            yield ("with",), f"the world has no body '{self.body}'{did_you_mean(self.body, bodies)}"
        links = links_with_shapes(scene.model)
        if self.link is not None and not any(self._is_of(link) for link in links):
            yield (
                ("link",),
                f"the robot has no link '{self.link}' with a collision shape{did_you_mean(self.link, links)}",
            )
        meant = [link for link in links if self._is_of(link)]
        travels = any(body.name == self.body and body.path for body in scene.world.objects)
        if travels and (self.has_least or self.has_most) and meant and scene.bolted_links.issuperset(meant):
            whose = f"'{meant[0]}'" if len(meant) == 1 else "these links"
            problem = (
                f"there is no force between '{self.body}' and {whose}: '{self.body}' follows its path, {whose} cannot"
            )
            yield (), f"{problem} move, and neither gives way; remove the limits, or name a link that can move"
        rate = scene.physics.rate
        if (self.has_least or self.has_most) and self.window * rate < 1 - STEP_EPSILON:
            step, least = duration_text(1 / rate), 1 / self.window - STEP_EPSILON
            problem = (
                f"{duration_text(self.window)} is shorter than a physics step of {step} (physics.rate: {rate:g} Hz)"
            )
            faster = f"physics.rate to at least {math.ceil(least)} Hz, or " if least <= MAX_PHYSICS_RATE_HZ else ""
            yield ("window",), f"{problem}; raise {faster}the window"

    def _is_of(self, link: str) -> bool:
        return self.link is None or matches_name(self.link, link)

    def is_meant(self, contact: Contact) -> bool:
        """Return True if the contact is between the named link and body."""
        return contact.body == self.body and self._is_of(contact.link)

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        rate = scene.physics.rate
        return TouchMonitor(
            self,
            1 / rate,
            HoldTime(self.span or 0.0),
            MeanForce.of(rate, self.window, filter(self.is_meant, start.contacts)),
            Bounds("", "N", self.at_least, self.at_most),
            Bounds("", "N s", *self.impulse_limits),
        )


_MAX_CONTACT_GAP_S: Final = 0.05  # in MuJoCo, a body that is pushed loses contact for up to five steps at a time


@dataclass(frozen=True, slots=True)
class TouchMonitor(Monitor):
    """The fold of the contacts over all steps; a stored trace may have fewer steps than contacts."""

    spec: Touch
    step: float  # duration of a physics step in s of sim time
    stretch: HoldTime  # the fold of the time for which the contact lasts and is strong enough
    mean: MeanForce  # the mean force so far
    force: Bounds  # the fold of the mean force in N against its limits
    impulse: Bounds  # the fold of the impulse in N s against its limits
    first: float | None = None  # sim time in s of the first contact
    # sim time in s of the first contact without a force, see `Contact.has_force`; only if there are limits
    unknown: float | None = None
    last: float | None = None  # sim time in s of the last contact
    nearest: Nearness | None = None  # the least distance
    # another contact: of the body with another link if there is one, else the first of all
    instead: Contact | None = None
    end: float | None = None  # sim time of the last step, in s

    @property
    @override
    def state(self) -> State:
        limits = joined(self.force.invariant.state, self.impulse.invariant.state)
        if self.unknown is not None and self.spec.has_most:
            limits = State.BROKEN
        return joined(limits, self.stretch.state) if self.spec.is_goal else limits

    @property
    def is_decided(self) -> bool:
        """See Monitor.is_decided. A contact decides, unless it may still become too strong."""
        return self.state is State.BROKEN or (self.state is State.HOLDS and not self.spec.has_most)

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The mean force looks back to before the window of the expectation."""
        return replace(self, mean=self.mean.observe(trace, filter(self.spec.is_meant, trace.contacts))[0])

    @override
    def observe(self, trace: Trace) -> Self:
        meant, others = self._sorted(trace)
        touches = times_of(meant)
        end = float(trace.time[-1]) if len(trace) else self.end
        first = float(touches[0]) if self.first is None and len(touches) else self.first
        unknown = self.unknown
        if unknown is None and (self.spec.has_least or self.spec.has_most):
            unknown = next((contact.time for contact in meant if not contact.has_force), None)
        nearest = contacts.nearest_of(trace, self.spec.watch, self.nearest)
        seen = replace(self, end=end, first=first, unknown=unknown, instead=self._instead_of(others), nearest=nearest)
        if self.spec.has_least or self.spec.has_most:
            seen = seen.pressed(*self.mean.observe(trace, meant))
        return seen.touched(touches) if len(touches) and not self.spec.has_least else seen

    def _sorted(self, trace: Trace) -> tuple[list[Contact], list[Contact]]:
        """Return the contacts between the named link and body, and the others."""
        meant: list[Contact] = []
        others: list[Contact] = []
        for contact in trace.contacts:
            if self.spec.is_meant(contact):
                meant.append(contact)
            elif contact.body != GROUND:
                others.append(contact)
        return meant, others

    def _instead_of(self, others: list[Contact]) -> Contact | None:
        candidates = others if self.instead is None else [self.instead, *others]
        of_body = (contact for contact in candidates if contact.body == self.spec.body)
        return next(of_body, next(iter(candidates), None))

    def pressed(self, mean: MeanForce, forces: Forces) -> Self:
        """Return the fold after these mean forces."""
        time, force = forces
        seen = replace(
            self,
            mean=mean,
            force=self.force.observe(time, force),
            impulse=self.impulse.observe(time, self._impulses(force)),
        )
        if not self.spec.has_least:
            return seen
        return replace(seen, stretch=self.stretch.observe(time, self._is_strong(force)))

    def _impulses(self, force: FloatArray) -> FloatArray:
        return force * self.mean.window

    def _is_strong(self, force: FloatArray) -> NDArray[np.bool_]:
        least, impulse = self.spec.at_least or 0.0, self.spec.impulse_limits[0] or 0.0
        return np.asarray((force - least >= 0) & (self._impulses(force) - impulse >= 0))

    def _is_gentle(self, force: FloatArray) -> NDArray[np.bool_]:
        most, impulse = self.spec.at_most, self.spec.impulse_limits[1]
        gentle = np.ones(len(force), dtype=bool) if most is None else np.asarray(most - force >= 0)
        return gentle if impulse is None else gentle & np.asarray(impulse - self._impulses(force) >= 0)

    def touched(self, time: FloatArray) -> Self:
        """Return the fold after these steps with a contact, (N,) s."""
        return replace(self, stretch=self.stretch.observe(*self._touching(time)), last=float(time[-1]))

    def _touching(self, time: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return times in s and True for contact: all of `time`, and False one step before each new contact."""
        longest = max(_MAX_CONTACT_GAP_S, 1.5 * self.step)
        begins = np.flatnonzero(np.diff(time, prepend=-np.inf if self.last is None else self.last) > longest)
        # `time` has no steps without contact: insert one before each new contact.
        moments = np.insert(time, begins, time[begins] - self.step)
        return moments, np.insert(np.ones(len(time), dtype=bool), begins, np.zeros(len(begins), dtype=bool))

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. It is true at each step at which the force is within its limits.

        Without a lower limit, a goal also needs a contact at that step. A contact that may be older than the run has no
        known mean force before the end of a window, but at least the one so far: such moments are left out.
        """
        meant, _ = self._sorted(trace)
        touches = contacts.touching_at(trace, times_of(meant), self.step)
        if not (self.spec.has_least or self.spec.has_most):
            return touches
        time, force = self.mean.observe(trace, meant)[1]
        force = force[np.searchsorted(time, touches.time - self.step / 2)]
        gentle = self._is_gentle(force)
        strong = self._is_strong(force)
        if self.spec.has_most:
            blind = times_of(contact for contact in meant if not contact.has_force)
            gentle &= ~contacts.touching_at(trace, blind, self.step).holds
        decided = ~self.mean.is_filling(touches.time, meant) | ~gentle | (strong & (not self.spec.has_most))
        holds = gentle & (touches.holds if self.spec.is_goal and not self.spec.has_least else strong)
        return Truth(touches.time[decided], holds[decided])

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns duration, mean force, impulse, contact (0 or 1) and least distance."""
        spec, body, over = self.spec, self.spec.body, duration_text(self.mean.window)
        meant, _ = self._sorted(trace)
        touches = times_of(meant)
        moments, force = self.mean.observe(trace, meant)[1]
        has_force = not meant or any(contact.has_force for contact in meant)
        pressing = [self.force.drawn(f"force on {body}, mean over {over}", moments, force)] if has_force else []
        if spec.impulse is not None and has_force:
            impulse = self.impulse.drawn(f"impulse on {body} within {over}", moments, self._impulses(force))
            pressing.insert(0 if spec.at_least is None and spec.at_most is None else 1, impulse)
        contact = contacts.with_zeros(trace.time, touches, np.ones(len(touches)), self.step)
        touching = Signal(f"touching {body}", "contacts", *contact, lower=1.0 if spec.is_goal else None)
        asked: list[Signal] = []
        if spec.span is not None:
            strong = self._touching(touches) if len(touches) else (trace.time, trace.time < 0)
            if spec.has_least:
                strong = (moments, self._is_strong(force))
            asked = [Signal(f"time touching {body}", "s", strong[0], self.stretch.lasting(*strong), lower=spec.span)]
        asked += [*pressing, touching] if spec.has_least or spec.has_most else [touching, *pressing]
        return (*asked, *self._nearness(trace))

    def _nearness(self, trace: Trace) -> Iterator[Signal]:
        time, distance = (None, None) if self.spec.watch is None else contacts.least_so_far(trace, self.spec.watch)
        if time is not None and distance is not None and len(time):
            yield Signal(f"least distance to {self.spec.body}", "m", time, distance)

    def verdict(self) -> Verdict:
        """Return the verdict on an exceeded limit, else on a missing requirement, else on the strictest one."""
        limits = [one for one in (self.force, self.impulse) if one.at_least is not None or one.at_most is not None]
        broken = [one for one in limits if one.invariant.state is State.BROKEN]
        if broken:
            return self._at_most(min(broken, key=lambda one: one.invariant.time or 0.0))
        if self.unknown is not None and self.spec.has_most:
            bounds = next(one for one in limits if one.at_most is not None)
            return self._no_force(bounds.unit, bounds.at_most, self.unknown)
        return self._reached(limits) if self.spec.is_goal else self._at_most(min(limits, key=_relative_margin))

    def _reached(self, limits: list[Bounds]) -> Verdict:
        """Return the verdict on a goal whose upper limits were kept."""
        spec = self.spec
        goals = [one for one in limits if one.at_least is not None]
        pending = [one for one in goals if one.goal.state is State.PENDING]
        if self.first is None and (pending or not goals):
            return self._counted()
        if pending or (goals and spec.span is None):
            return self._at_least((pending or goals)[0])
        return self._counted() if spec.span is None else self._lasting(spec.span)

    def _no_force(self, unit: str, limit: float | None, time: float) -> Verdict:
        message = f"touched {self.spec.body} at {time:.2f} s, {contacts.NO_FORCE}, so no limit can hold"
        return Verdict(False, None, limit, None, unit, time, message)

    def _counted(self) -> Verdict:
        body = self.spec.body
        if self.first is not None:
            message = f"touched {body} at {self.first:.2f} s"
            return Verdict(True, 1.0, 1.0, 0.0, "contacts", self.first, message, body=body)
        if self.end is None:
            return Verdict(False, None, 1.0, None, "contacts", None, "no physics step to measure")
        message = f"did not touch {body} in {self.end:.1f} s; {self._near()}{self._instead()}"
        return Verdict(False, 0.0, 1.0, -1.0, "contacts", self.end, message)

    def _at_least(self, bounds: Bounds) -> Verdict:
        fold, limit, unit = bounds.goal, bounds.at_least or 0.0, bounds.unit
        if fold.margin is None or fold.time is None:
            return Verdict(False, None, limit, None, unit, None, "no physics step to measure")
        passed, value = fold.state is State.HOLDS, limit + fold.margin
        if not passed and value <= 0 and self.unknown is not None:
            return self._no_force(unit, limit, self.unknown)
        measured, required = units.display_apart(value, limit, unit)
        reached = f"{measured}{'' if passed else f' of {required}'} at {fold.time:.2f} s"
        message = f"touched {self.spec.body} with {reached}{self._meaning(value, unit)}{self._kept() if passed else ''}"
        return Verdict(passed, value, limit, fold.margin, unit, fold.time, message)

    def _at_most(self, bounds: Bounds) -> Verdict:
        fold, limit, unit = bounds.invariant, bounds.at_most or 0.0, bounds.unit
        if fold.margin is None or fold.time is None:
            return Verdict(False, None, limit, None, unit, None, "no physics step to measure")
        passed, value, body = fold.state is State.HOLDS, limit - fold.margin, self.spec.body
        if self.first is None and value <= 0:
            message = f"did not touch {body}; {self._near()}to demand a touch, add `contact: {self._as_goal()}`"
            return Verdict(passed, value, limit, fold.margin, unit, self.end, message)
        measured, allowed = units.display_apart(value, limit, unit)
        compared = (
            f"at most {measured} at {fold.time:.2f} s, limit"
            if passed
            else f"{measured} at {fold.time:.2f} s, more than"
        )
        message = f"touched {body} with {compared} {allowed}{self._meaning(value, unit)}"
        return Verdict(passed, value, limit, fold.margin, unit, fold.time, message, body=body)

    def _meaning(self, value: float, unit: str) -> str:
        """Return a text that relates a mean force and an impulse, one of which is `value`, to the window."""
        window = self.mean.window
        if unit == "N":
            return f" ({units.display(value * window, 'N s')} within {duration_text(window)})"
        return f" (within {duration_text(window)}: {units.display(value / window, 'N')} on average)"

    def _kept(self) -> str:
        """Return the upper limits that were kept, for the message about a goal."""
        texts = []
        for bounds in (self.force, self.impulse):
            if bounds.at_most is not None and bounds.invariant.margin is not None:
                value = bounds.at_most - bounds.invariant.margin
                measured, allowed = units.display_apart(value, bounds.at_most, bounds.unit)
                texts.append(f"; at most {measured}, limit {allowed}{self._meaning(value, bounds.unit)}")
        return "".join(texts)

    def _as_goal(self) -> str:
        keys = {"with": self.spec.body, **({} if self.spec.link is None else {"link": self.spec.link})}
        return f"{{{', '.join(f'{key}: {value}' for key, value in keys.items())}}}"

    def _lasting(self, span: float) -> Verdict:
        touch = self.stretch
        lasted, required = units.display_apart(touch.longest, span, "s")
        how_long = lasted if touch.state is State.HOLDS else f"{lasted} of {required}"
        message = f"touched {self.spec.body} for {how_long}, from {touch.began:.2f} s on{self._kept()}"
        passed, margin = touch.state is State.HOLDS, touch.longest - span
        return Verdict(passed, touch.longest, span, margin, "s", touch.goal.time, message)

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


def _relative_margin(bounds: Bounds) -> float:
    if bounds.at_most is None or bounds.invariant.margin is None:
        return math.inf
    return bounds.invariant.margin / bounds.at_most
