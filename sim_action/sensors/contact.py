"""The contact sensor, for bumpers and feet: `contact: {}`."""

from __future__ import annotations

from typing import ClassVar

from typing_extensions import override

from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import ContactReading


class ContactSensor(Sensor):
    """Measures whether its link touches something, and with which force; the ground counts.

    A reading has `touching`, `force` (the sum of the normal forces in N) and `bodies` (the names of the touched
    bodies), at the physics step of the reading. In an impact, the force of one step depends on `physics.rate`; to limit
    forces, use the assertion `contact`. A touch between two readings is missing; `no_collision` sees it. Hard surfaces
    that are pressed together may separate many times per second: let a controller remember a touch.
    """

    key: ClassVar[str] = "contact"
    watches_contacts: ClassVar[bool] = True

    @override
    def open(self, mount: Mount) -> Measure:
        def measure(sight: Sight) -> ContactReading:
            touches = [contact for contact in sight.robot.contacts if contact.link == mount.link]
            bodies = tuple(sorted({contact.body for contact in touches}))
            force = sum(contact.force for contact in touches)
            return ContactReading(sight.time, bool(touches), force, bodies)

        return measure
