"""`no_collision`: the robot touches nothing but the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import FORCE_WINDOW_S, Monitor
from sim_action.assertions.monitors.contacts import (
    FirstTouchMonitor,
    MeanForce,
    clearance_signal,
    duration_text,
    strength,
)
from sim_action.core.records import dataclass
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.robot_model import has_limb
from sim_action.state.observation import Contact, Observation
from sim_action.state.timeline import is_late
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.ground import GROUND
from sim_action.world.link_range import out_of_reach
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
        return self.touched(self.first.link, self.first.body, strength(self.first), self.first.body)
