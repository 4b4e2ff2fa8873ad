"""The contacts of a replay: successive contacts of a link with a body are one touch, with its force over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from sim_action.assertions.monitors import FORCE_WINDOW_S
from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Vector3
from sim_action.core.records import dataclass, field
from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import MAX_CONTACTS, ContactData
from sim_action.recording.replay.shapes import MAX_ABS_VALUE, Place, numbers
from sim_action.state.observation import Contact
from sim_action.state.trace_records import FRAME_RATE

# The number of values of the force over time: of all contacts together, and the limits for one.
_MAX_VALUES: Final = 12_000
_LEAST_VALUES: Final = 30
_MOST_VALUES: Final = 300
_FORCE_STEP_N: Final = 0.01
_PLACE_STEP_M: Final = 1e-3
_LEAST_WEIGHT_N: Final = 1e-9

# A shorter gap does not end a contact, for example of a robot that rattles along a wall.
_MAX_GAP_S: Final = 0.1


@dataclass(slots=True)
class Touch:
    """An uninterrupted contact of a link with a body.

    Attributes:
        points: the contact points in the order of time.
        until: the time in s of the last contact.
        steps: the time in s of each step with a contact, and the total force in N.
        push: the sum of the forces on the link in N, as a vector in the world frame.
    """

    points: list[Contact]
    until: float
    steps: list[tuple[float, float]] = field(default_factory=list)
    push: Vector3 = ZERO

    @property
    def first(self) -> Contact:
        """The first contact point."""
        return self.points[0]

    def add(self, contact: Contact) -> None:
        """Add a contact point of the same or a later step."""
        self.points.append(contact)
        before = self.steps.pop()[1] if self.steps and contact.time == self.until else 0.0
        self.steps.append((contact.time, before + contact.force))
        self.until = contact.time
        self.push = geometry.add(self.push, geometry.scale(contact.normal_xyz, contact.force))

    @property
    def normal(self) -> Place | None:
        """The unit vector of the mean force on the link, world frame; None if it is not known."""
        length = math.hypot(*self.push)
        if not length:
            return None
        x, y, z = numbers(geometry.scale(self.push, 1 / length))
        return (x, y, z)

    def over_time(self, rate: float, most: int) -> tuple[float, Column, tuple[Column, Column, Column]]:
        """Return a period in s, and the mean force in N and its place in m in each period since the first contact."""
        span = self.until - self.first.time + 1 / rate
        # A whole number of steps, so that each period has as many.
        period = math.ceil(max(1 / FRAME_RATE, span / most) * rate - 1e-6) / rate
        since = np.array([point.time for point in self.points]) - self.first.time
        periods = np.floor(since / period + 1e-6).astype(np.int64)
        forces = np.array([point.force for point in self.points])
        sums = np.bincount(periods, weights=forces)
        force = Column.encoded(np.minimum(sums / (period * rate), MAX_ABS_VALUE), _FORCE_STEP_N)
        # Points without a force count only if no other point has one.
        weights = np.maximum(forces, _LEAST_WEIGHT_N)
        known = np.flatnonzero(sums_of_weights := np.bincount(periods, weights=weights))
        x, y, z = (
            Column.encoded(
                np.interp(
                    np.arange(len(sums)),
                    known,
                    np.bincount(periods, weights=weights * axis)[known] / sums_of_weights[known],
                ),
                _PLACE_STEP_M,
            )
            for axis in np.array([point.position_xyz for point in self.points]).T
        )
        return period, force, (x, y, z)

    def force(self, rate: float) -> float:
        """Return the greatest mean force in N over FORCE_WINDOW_S, or over one step if that is longer."""
        window = max(FORCE_WINDOW_S, 1 / rate)
        most = present = 0.0
        oldest = 0
        for time, force in self.steps:
            present += force
            while self.steps[oldest][0] <= time - window + 0.5 / rate:
                present -= self.steps[oldest][1]
                oldest += 1
            most = max(most, present)
        return most / (window * rate)

    def impulse(self, rate: float) -> float:
        """Return the impulse of the whole contact in N s."""
        return sum(force for _, force in self.steps) / rate


def joined_touches(contacts: Iterable[Contact]) -> list[Touch]:
    """Join successive contacts of a link with a body, and return the touches in the order of their start."""
    found: list[Touch] = []
    lasting: dict[tuple[str, str], Touch] = {}
    for contact in contacts:
        pair = contact.link, contact.body
        touch = lasting.get(pair)
        if touch is None or contact.time - touch.until > _MAX_GAP_S:
            touch = lasting[pair] = Touch([], contact.time)
            found.append(touch)
        touch.add(contact)
    return found


def strongest_touches(
    touches: list[Touch], links: Mapping[str, int], bodies: Mapping[str, int], rate: float
) -> tuple[tuple[ContactData, ...], int]:
    """Return the strongest touches in the order of time, and the number of the others.

    `links` and `bodies` map names to indices; `rate`: physics steps per second.
    """
    known = [touch for touch in touches if touch.first.link in links and touch.first.body in bodies]
    # A contact without a force comes first: neither of the two gives way.
    most = sorted(known, key=lambda touch: (touch.first.has_force, -touch.force(rate)))[:MAX_CONTACTS]
    values = min(_MOST_VALUES, max(_LEAST_VALUES, _MAX_VALUES // max(1, len(most))))
    kept = tuple(
        _contact_data(touch, links[touch.first.link], bodies[touch.first.body], rate, values)
        for touch in sorted(most, key=lambda touch: touch.first.time)
    )
    return kept, len(known) - len(kept)


def _contact_data(touch: Touch, link: int, body: int, rate: float, values: int) -> ContactData:
    x, y, z = numbers(touch.first.position_xyz)
    force, impulse = (round(min(value, MAX_ABS_VALUE), 3) for value in (touch.force(rate), touch.impulse(rate)))
    time, until = numbers((touch.first.time, touch.until))
    normal = touch.normal
    period, forces, places = (None, None, None) if normal is None else touch.over_time(rate, values)
    return ContactData(
        time=time,
        until=until,
        link=link,
        body=body,
        position=(x, y, z),
        force=force if touch.first.has_force else None,
        impulse=impulse,
        normal=normal,
        period=period,
        forces=forces,
        places=places,
    )
