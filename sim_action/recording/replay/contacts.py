"""Contacts of a run: those of a link with a body that follow each other are one, and the strongest are kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from sim_action.recording.replay.models import MAX_CONTACTS, ContactData
from sim_action.recording.replay.shapes import FARTHEST, numbers
from sim_action.state.observation import Contact

# In s: what lets go for so short a time, as what rattles along a wall does, goes on.
_GAP: Final = 0.1


@dataclass(slots=True)
class Touch:
    """A link at a body without a gap, from its first contact.

    Attributes:
        until: s, its last step.
        force: N of all points of a step, at most.
        present: N of those of its last step.
    """

    first: Contact
    until: float
    force: float = 0.0
    present: float = 0.0

    def add(self, contact: Contact) -> None:
        """One more point."""
        self.present = contact.force + (self.present if contact.time == self.until else 0.0)
        self.until = contact.time
        self.force = max(self.force, self.present)


def joined(contacts: Iterable[Contact]) -> list[Touch]:
    """The touches, in the order in which they begin."""
    found: list[Touch] = []
    lasting: dict[tuple[str, str], Touch] = {}
    for contact in contacts:
        pair = contact.link, contact.body
        touch = lasting.get(pair)
        if touch is None or contact.time - touch.until > _GAP:
            touch = lasting[pair] = Touch(contact, contact.time)
            found.append(touch)
        touch.add(contact)
    return found


def strongest(
    touches: list[Touch], links: Mapping[str, int], bodies: Mapping[str, int]
) -> tuple[tuple[ContactData, ...], int]:
    """Those that are kept, in the order of time, and how many are not; by the numbers of links and bodies."""
    known = [touch for touch in touches if touch.first.link in links and touch.first.body in bodies]
    most = sorted(known, key=lambda touch: -touch.force)[:MAX_CONTACTS]
    kept = tuple(
        _data(touch, links[touch.first.link], bodies[touch.first.body])
        for touch in sorted(most, key=lambda touch: touch.first.time)
    )
    return kept, len(known) - len(kept)


def _data(touch: Touch, link: int, body: int) -> ContactData:
    x, y, z = numbers(touch.first.position_xyz)
    force = round(min(touch.force, FARTHEST), 3)
    time, until = numbers((touch.first.time, touch.until))
    return ContactData(time=time, until=until, link=link, body=body, position=(x, y, z), force=force)
