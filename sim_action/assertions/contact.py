"""`contact: {with: ball, link: hand, at_most: 20 N}`: the robot touches a body."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.bounds import check_order
from sim_action.core import units
from sim_action.core.field_types import PositiveNewtons, PositiveSeconds
from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Contact, Observation

_PATTERN: Final = re.compile(r"[*?\[]")


class Touch(Assertion):
    """A goal: the robot touches a body of the world; an invariant: never with more than a force.

    The force is what presses them together, over all points at which they touch in one physics step: a blow lasts for
    few of these, so it is large. What is pushed along bounces: a touch lasts on where it is lost for 50 ms or less.
    """

    key: ClassVar[str] = "contact"

    body: Annotated[str, Field(alias="with", min_length=1, description="name of the object")]
    link: Annotated[
        str | None, Field(min_length=1, description="of the robot, or a pattern such as '*_finger'; left out: any")
    ] = None
    at_least: Annotated[PositiveNewtons | None, Field(description="a goal: what is less does not count")] = None
    at_most: Annotated[PositiveNewtons | None, Field(description="an invariant: must not be exceeded")] = None
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="how long it has to last; left out: one physics step")
    ] = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        check_order(self.at_least, self.at_most, "N")
        return self

    @property
    def watch(self) -> ClearanceWatch | None:
        """Tells how near it came, for the robot that does not touch; None for links that only the model tells."""
        if self.link is not None and _PATTERN.search(self.link):
            return None
        return ClearanceWatch(None if self.link is None else (self.link,), (self.body,))

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(contacts=True, clearances=frozenset() if self.watch is None else frozenset({self.watch}))

    @property
    def title(self) -> str:
        """See Assertion.title."""
        by = "" if self.link is None else f" of {self.link}"
        limits = (("at least", self.at_least, "N"), ("at most", self.at_most, "N"), ("for", self.span, "s"))
        asked = (f"{word} {units.display(value, unit)}" for word, value, unit in limits if value is not None)
        return f"contact{by} with {self.body} {', '.join(asked)}".rstrip()

    def problems(self, scene: Scene) -> SpecProblems:
        """A body or a link that is not there."""
        bodies = [body.name for body in scene.world.objects]
        if self.body == GROUND:
            yield ("with",), "contacts with the ground are not watched; name an object"
        elif self.body not in bodies:
            yield ("with",), f"the world has no body '{self.body}'{did_you_mean(self.body, bodies)}"
        # What is in MuJoCo's own format tells its shapes to the engine alone.
        links = [link.name for link in scene.model.links if link.collisions or scene.model.mjcf]
        if self.link is not None and not any(self._is_of(link) for link in links):
            yield (
                ("link",),
                f"the robot has no link '{self.link}' with a collision shape{did_you_mean(self.link, links)}",
            )

    def _is_of(self, link: str) -> bool:
        return self.link is None or link == self.link or fnmatchcase(link, self.link)

    def is_meant(self, contact: Contact) -> bool:
        """Whether it is between the right two."""
        return contact.body == self.body and self._is_of(contact.link)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.contact_monitor import TouchMonitor
        from sim_action.assertions.stretch import Stretch

        return TouchMonitor(self, 1 / scene.physics.rate, Stretch(self.span or 0.0))
