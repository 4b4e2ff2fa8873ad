"""`contact: {with: ball, link: hand, at_most: 20 N}` and `grasped`: the robot touches a body, or holds it."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import FORCE_WINDOW_S, Monitor
from sim_action.assertions.monitors.bounds import Bounds, bounds_title, check_bounds, check_order
from sim_action.assertions.monitors.contact_force import MeanForce, duration_text
from sim_action.assertions.monitors.goals import HoldTime
from sim_action.assertions.monitors.grip import GraspMonitor
from sim_action.assertions.monitors.touch import TouchMonitor
from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    PositiveMetresPerSecond,
    PositiveNewtons,
    PositiveNewtonSeconds,
    PositiveSeconds,
)
from sim_action.core.units import STEP_EPSILON
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.model.joint_selection import link_name_problems, links_named, links_with_shapes, matches_name
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.ground import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Contact, Observation


# The least squeeze of a grip by default.
_SHARE_OF_WEIGHT: Final = 0.1
_MIN_SQUEEZE_N: Final = 1e-6

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

    A touch is a goal, also with `at_least` or `for`. `at_most` is an invariant. `at_most` alone does not demand a
    touch: no contact is a force of 0 N. To demand a touch as well, add `contact: {with: ball}` to `expect`. A contact
    in which neither side can give way, such as of a bolted arm and a body on a path, has no force and meets no limit.

    The force is the sum over all contact points of the two, averaged over the last `window` at each step. The force of
    a single step depends on `physics.rate`, because an impact may last one step. The impulse is the mean force times
    `window`: the momentum that passes in this time. At `after`, the window reaches back to before `after`.

    A body that is pushed may lose contact for a moment: a loss for 50 ms or less does not interrupt the contact. With
    `at_least`, the mean force must last instead.
    """

    key: ClassVar[str] = "contact"
    sees_shapes: ClassVar[bool] = True
    bare_value: ClassVar[str | None] = "with"

    body: Annotated[str, Field(alias="with", min_length=1, description="name of the object; may be the whole value")]
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
        PositiveSeconds,
        Field(le=10, description="time over which the force is averaged; at least one physics step"),
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
    def run_claims(self, run: JudgedRun) -> Findings:
        if not self.is_goal and run.verdict.passed and run.verdict.measured == 0:
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
        return Channels(contacts=True, clearances=frozenset() if self.watch is None else frozenset({self.watch}))

    @property
    @override
    def hold_time(self) -> float | None:
        return self.span

    @property
    def is_goal(self) -> bool:
        """See Assertion.is_goal. An upper limit alone does not demand a touch."""
        return self.has_least or self.span is not None or not self.has_most

    @property
    @override
    def has_truth(self) -> bool:
        return True

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
        bodies = [body.name for body in scene.world.objects]
        if self.body == GROUND:
            yield ("with",), "contacts with the ground are not recorded; name an object"
        elif self.body not in bodies:
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
            found = (
                f"there is no force between '{self.body}' and {whose}: '{self.body}' follows its path, {whose} cannot"
            )
            yield (), f"{found} move, and neither gives way; remove the limits, or name a link that can move"
        rate = scene.physics.rate
        if (self.has_least or self.has_most) and self.window * rate < 1 - STEP_EPSILON:
            step, least = duration_text(1 / rate), 1 / self.window - STEP_EPSILON
            found = f"{duration_text(self.window)} is shorter than a physics step of {step} (physics.rate: {rate:g} Hz)"
            faster = f"physics.rate to at least {math.ceil(least)} Hz, or " if least <= MAX_PHYSICS_RATE_HZ else ""
            yield ("window",), f"{found}; raise {faster}the window"

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


class Grasped(Assertion):
    """Links of the robot hold an object between them: at least two press it from opposed sides, and it does not slide.

    It is a goal. The object is held while three conditions are true, for the mean of the last 50 ms. At least two of
    the links `by` press it. Their normal forces are opposed: at least half of their sum cancels, so two equal forces
    differ by 120 deg or more. It does not move along any of them faster than `slip`. The squeeze is half of the forces
    that cancel, which is the force of each of two fingers; it must be at least `at_least`. An object that is pushed
    from one side, or that lies on a palm, is not held. An object that is squeezed while it still stands on a table is
    held: to demand that it is lifted, add `object: {name: cube, moved: {up: 10 cm}}`.
    """

    key: ClassVar[str] = "grasped"

    object: Annotated[str, Field(min_length=1, description="name of the object, which must have a mass")]
    by: Annotated[tuple[str, ...], Field(min_length=1, description="two or more links, or patterns such as '*_finger'")]
    at_least: Annotated[
        PositiveNewtons | None, Field(description="least squeeze; default: a tenth of the weight of the object")
    ] = None
    slip: Annotated[PositiveMetresPerSecond, Field(description="greatest speed of the object along a link")] = 0.05
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="required duration; default: one physics step")
    ] = None

    @property
    @override
    def channels(self) -> Channels:
        return Channels(objects=frozenset({self.object}), link_contacts=frozenset(self.by))

    @property
    @override
    def is_goal(self) -> bool:
        return True

    @property
    @override
    def has_truth(self) -> bool:
        return True

    @property
    @override
    def hold_time(self) -> float | None:
        return self.span

    @property
    @override
    def title(self) -> str:
        force = "" if self.at_least is None else f" with at least {units.display(self.at_least, 'N')}"
        span = "" if self.span is None else f" for {units.display(self.span, 's')}"
        return f"grasped {self.object} by {', '.join(self.by)}{force}{span}"

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown object, one without a mass, unknown links, and a single link."""
        bodies = {body.name: body for body in scene.world.objects}
        body = bodies.get(self.object)
        if body is None:
            yield ("object",), f"the world has no body '{self.object}'{did_you_mean(self.object, bodies)}"
        elif body.mass is None:
            yield ("object",), f"'{self.object}' has no mass, so the robot cannot hold it; give it one"
        unknown = list(link_name_problems(scene.model, "by", self.by))
        yield from unknown
        links = links_named(scene.model, self.by)
        if not unknown and len(links) < 2:
            yield ("by",), f"only '{links[0]}' is named, and it takes two links to hold an object; add another one"

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        mass = next((body.mass for body in scene.world.objects if body.name == self.object), None) or 0.0
        least = self.at_least or max(_MIN_SQUEEZE_N, _SHARE_OF_WEIGHT * mass * scene.world.weight)
        return GraspMonitor(self, scene.model, links_named(scene.model, self.by), least, HoldTime(self.span or 0.0))
