"""`no_collision`: the robot touches nothing but the ground; `self_collision`: no link of it touches another one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, ClassVar, Final

from pydantic import Field, field_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import FORCE_WINDOW_S, Monitor
from sim_action.assertions.monitors.contacts import (
    FirstTouchMonitor,
    MeanForce,
    clearance_signal,
    duration_text,
    strength,
)
from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import matches_name
from sim_action.robot.model.robot_model import NO_PAIRS, has_limb, touchable_pairs
from sim_action.state.observation import Contact, Observation, SelfContact
from sim_action.state.timeline import is_late
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.physics import GROUND
from sim_action.world.robot_reach import least_distance, out_of_reach
from sim_action.world.scene import Scene


class NoCollision(Assertion):
    """No link of the robot touches a body of the world, except the ground and the names in `allow`.

    Contacts between links of the robot do not count: `self_collision` judges them.
    """

    key: ClassVar[str] = "no_collision"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "invariant",
        "The robot touched no body at any step. With no body that it could touch, the [audit of "
        "claims](claims.md) adds a warning.",
        "The robot touched a body that `allow` does not name.",
    )
    measured_unit: ClassVar[str | None] = "contacts"
    sees_shapes: ClassVar[bool] = True

    allow: Annotated[
        tuple[str, ...], Field(description="objects that may be touched, and links of the robot that may touch")
    ] = ()

    channels: ClassVar[Channels] = Channels(contacts=True)

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        return "no_collision" + (f" but {', '.join(self.allow)}" if self.allow else "")

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield names in `allow` that are neither a link nor an object."""
        names = {*scene.model.links_by_name, *scene.world.names, GROUND}
        hinted = FirstFew()
        for index, name in enumerate(self.allow):
            if name not in names:
                hint = did_you_mean(name, names) if hinted.one_more() else ""
                yield ("allow", index), f"'{name}' is neither an object nor a link{hint}"

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return False

    @override
    def meaning(self, scene: Scene) -> str:
        bodies = [name for name in scene.world.names if name not in self.allow]
        if not bodies or not scene.model.links_by_name.keys().isdisjoint(self.allow):
            return ""
        return f"always ({' and '.join(f'{clearance_signal(body)} > 0' for body in bodies)})"

    @override
    def claims(self, setting: Setting) -> Findings:
        """Yield a world in which nothing may be touched that is not allowed."""
        bodies = setting.world.objects
        touchable = [body for body in bodies if body.name not in (*self.allow, GROUND)]
        if any(not is_late(body.appears, setting.end) for body in touchable) or any(
            actor.name not in self.allow for actor in setting.world.actors
        ):
            return
        reason = (
            f"every object that may not be touched appears only after the check, which ends at {setting.end:g} s"
            if touchable
            else "allow names every object of the world"
            if setting.world.names
            else "the world has no objects, and the ground never counts"
        )
        use = "add an object to world.objects, or remove no_collision"
        message = f"{reason}, so the robot cannot touch anything; {use}"
        yield ClaimFinding("nothing-to-touch", (), message)

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        # Only the engine knows the shapes of an MJCF model.
        shaped = set() if scene.model.mjcf else {link.name for link in scene.model.links if link.collisions}
        if shaped and shaped <= set(self.allow):
            message = "allow names every link with a collision shape, so no touch counts; remove links from allow"
            yield ClaimFinding("nothing-to-touch", (), message)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a world whose objects were all below the ground or above the robot."""
        if run.scene.actors.keys() <= {*self.allow}:
            bodies = [body for body in run.scene.world.objects if body.name not in (*self.allow, GROUND)]
            yield from out_of_reach(run, bodies)

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        limbs = has_limb(scene.model, bolted=scene.bolted)
        return NoCollisionMonitor(1 / scene.physics.rate, allowed=frozenset(self.allow), has_limb=limbs)


@dataclass(frozen=True, slots=True)
class NoCollisionMonitor(FirstTouchMonitor):
    """The monitor of the first contact with a body.

    The run ends at that contact, so there is no mean force yet, and the force of one step depends on the rate.
    """

    allowed: frozenset[str] = frozenset()
    has_limb: bool = False  # True for an arm or a leg, whose links can touch each other

    @override
    def summed(self, touches: Sequence[Contact]) -> Contact:
        first = touches[0]
        points = [one for one in touches if (one.time, one.link, one.body) == (first.time, first.link, first.body)]
        return first._replace(force=sum(one.force for one in points))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns contact (0 or 1) at each step, and the mean force if there is any."""
        forbidden = self.forbidden(trace)
        touching = self.touching("touching something", trace, forbidden)
        if forbidden and not any(contact.has_force for contact in forbidden):
            return (touching,)
        mean = MeanForce(1 / self.step, max(FORCE_WINDOW_S, self.step))
        name = f"contact force, mean over {duration_text(mean.window)}"
        return (touching, Signal(name, "N", *mean.observe(trace, forbidden)[1]))

    @override
    def forbidden(self, trace: Trace) -> list[Contact]:
        ignored = {*self.allowed, GROUND}
        return [one for one in trace.contacts if one.link not in self.allowed and one.body not in ignored]

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the number of forbidden contacts, 0 or 1."""
        if self.first is None:
            own = "; its own links do not count (self_collision watches them)" if self.has_limb else ""
            message = f"touched nothing{' else' if self.allowed else ''}{own}"
            return Verdict(True, 0.0, 0.0, 0.0, "contacts", self.end, message)
        link, body, how = self.first.link, self.first.body, strength(self.first)
        if self.first.time <= self.step:
            how += f"; if the robot stands on it, add allow: [{body}]"
        return self.touched(link, body, how, body)


_PAIRS: Final = "expected a list of pairs"
_NOT_JUDGED: Final = "they are neighbours, parts of one rigid body, without a collision shape, or disabled by the model"


class SelfCollision(Assertion):
    """No link of the robot touches another link, except neighbours and the pairs in `allow`.

    With `robot.self_collision: true`, links push each other away, and a touch has a force. Otherwise they pass through
    each other: their distances are measured, and an overlap of more than 0.1 mm is a touch.

    Neighbours, which one joint connects, never count. Neither do pairs that touch where the model itself puts its
    joints, which a note names, and pairs that the SRDF (`robot.srdf`) or MJCF disables.
    """

    key: ClassVar[str] = "self_collision"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "invariant",
        "No two links of the robot touched each other at any step, except neighbours and allowed pairs.",
        "Two links touched each other that `allow` does not name.",
    )
    measured_unit: ClassVar[str | None] = "contacts"

    allow: Annotated[
        tuple[tuple[str, str], ...],
        Field(description="pairs of links that may touch, such as `[left_finger, right_finger]`; patterns work, too"),
    ] = ()

    @field_validator("allow", mode="before")
    @classmethod
    def _takes_pairs(cls, data: Any) -> Any:
        if isinstance(data, str):
            raise ValueError(f"{_PAIRS}, such as [[{data}, ANOTHER_LINK]]")  # noqa: TRY004 - pydantic's
        if isinstance(data, (list, tuple)) and data and all(isinstance(name, str) for name in data):
            one, *others = data
            remedy = f"; write [[{one}, {others[0]}]]" if len(others) == 1 else f", such as [[{one}, ANOTHER_LINK]]"
            raise ValueError(f"{_PAIRS}{remedy}")
        return data

    channels: ClassVar[Channels] = Channels(self_contacts=True)

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        pairs = ", ".join(f"{one} with {other}" for one, other in self.allow)
        return shortened_title("self_collision" + (f" but {pairs}" if pairs else ""))

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield names in `allow` that match no link, and a robot whose links cannot touch each other."""
        links, hinted, names_exist = scene.model.links_by_name, FirstFew(), True
        for index, pair in enumerate(self.allow):
            for place, name in enumerate(pair):
                if not any(matches_name(name, link) for link in links):
                    names_exist = False
                    hint = did_you_mean(name, links) if hinted.one_more() else ""
                    yield ("allow", index, place), f"the robot has no link '{name}'{hint}"
        pairs = touchable_pairs(scene.model)
        first = next(pairs, None)
        if first is None:
            yield (), f"it would check nothing: {NO_PAIRS}"
        elif names_exist and self.allow:
            meant = [first, *pairs]
            for index, names in enumerate(self.allow):
                if not any(_names(names, pair) for pair in meant):
                    message = f"{names[0]} and {names[1]} are not judged: {_NOT_JUDGED}; remove this pair"
                    yield ("allow", index), message
            if all(_allows(self.allow, pair) for pair in meant):
                yield ("allow",), "it names every pair of links that can touch, so no touch counts; remove pairs"

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        """Yield a robot whose links never come near each other, such as two wheels."""
        pairs = (pair for pair in touchable_pairs(scene.model) if not _allows(self.allow, pair))
        if not scene.model.mjcf and all(least_distance(scene, *pair) > 0 for pair in pairs):
            message = "no two links can come near each other, whatever their joints; remove self_collision"
            yield ClaimFinding("nothing-to-touch", (), message)

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return False

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        return SelfCollisionMonitor(1 / scene.physics.rate, allowed=self.allow, collides=scene.robot.self_collision)


def _allows(allowed: Iterable[tuple[str, str]], pair: tuple[str, str]) -> bool:
    return any(_names(names, pair) for names in allowed)


def _names(names: tuple[str, str], pair: tuple[str, str]) -> bool:
    one, other = names
    return any(matches_name(one, first) and matches_name(other, second) for first, second in (pair, pair[::-1]))


@dataclass(frozen=True, slots=True)
class SelfCollisionMonitor(FirstTouchMonitor):
    """The monitor of the first contact between links."""

    allowed: tuple[tuple[str, str], ...] = ()
    collides: bool = False  # True if links push each other away

    @override
    def forbidden(self, trace: Trace) -> list[SelfContact]:
        return [touch for touch in trace.self_contacts if not _allows(self.allowed, (touch.link, touch.other))]

    @override
    def summed(self, touches: Sequence[SelfContact]) -> SelfContact:
        first = touches[0]
        points = [one for one in touches if (one.time, one.link, one.other) == (first.time, first.link, first.other)]
        return first._replace(force=sum(one.force for one in points), depth=max(one.depth for one in points))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns contact (0 or 1) at each step."""
        return (self.touching("touching itself", trace, self.forbidden(trace)),)

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the number of forbidden contacts, 0 or 1."""
        if self.first is None:
            message = "its links did not touch each other" + (", but for allowed pairs" if self.allowed else "")
            return Verdict(True, 0.0, 0.0, 0.0, "contacts", self.end, message)
        how = f"{units.display(self.first.depth, 'm')} deep"
        if self.first.force:
            how = f"with {units.display(self.first.force, 'N')} in that physics step"
        elif not self.collides:
            how += " (links pass through each other: robot.self_collision is off)"
        return self.touched(self.first.link, self.first.other, how)
