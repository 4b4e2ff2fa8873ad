"""Bumpers and feet: `contact`."""

from __future__ import annotations

from typing import ClassVar

from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import ContactReading


class ContactSensor(Sensor):
    """Tells whether its link touches anything at the moment, and how hard; the ground counts.

    A reading has `touching`, `force` (N, the sum of normal forces) and `bodies`, the names of what is touched. It is of
    the moment at which it is read: a bounce between two readings is not in it, and `no_collision` sees that one, too.
    What is hard and pressed against something hard may let go and hit it many times a second, so that it is for the
    controller to remember a touch.
    """

    key: ClassVar[str] = "contact"
    watches_contacts: ClassVar[bool] = True

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open."""

        def measure(sight: Sight) -> ContactReading:
            touches = [contact for contact in sight.robot.contacts if contact.link == mount.link]
            bodies = tuple(sorted({contact.body for contact in touches}))
            force = sum(contact.force for contact in touches)
            return ContactReading(sight.time, bool(touches), force, bodies)

        return measure
