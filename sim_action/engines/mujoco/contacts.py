"""Contacts and overlaps in MuJoCo, with the names of links and bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import mujoco

from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.state.observation import Clash, Contact, Overlap
from sim_action.state.trace_records import LinkTouch
from sim_action.world import GROUND

_MAX_REMEMBERED_PAIRS: Final = 256


class Contacts:
    """Reads the contacts of the last step."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._compiled, self._model, self._data = compiled, compiled.model, compiled.data
        self._links, self._bodies = compiled.links, compiled.bodies
        objects = {geom for geom, body in self._bodies.items() if body != GROUND}
        self._matters = objects.union(self._links)
        # Sets of touching geoms in which no pair matters.
        self._harmless: set[bytes] = set()

    def may_matter(self, touching: bytes) -> bool:
        """Return True if something other than the ground may be touched now; called at every step.

        `touching`: see `SlidingContacts`.
        """
        # At most steps only wheels touch the ground, so the set of geoms is seldom new.
        if not touching or touching in self._harmless:
            return False
        matters = any(self._matters.issuperset(pair) for pair in self._data.contact.geom.tolist())
        if not matters:
            if len(self._harmless) == _MAX_REMEMBERED_PAIRS:
                self._harmless.clear()
            self._harmless.add(touching)
        return matters

    def of_step(self, time: float, *, ground: bool) -> Iterator[Contact]:
        """Yield the present contacts of the robot, with or without the ground."""
        contacts, forces = self._data.contact, self._data.efc_force
        columns = contacts.geom, contacts.efc_address, contacts.pos, contacts.dist, contacts.frame
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for (one, other), row, (x, y, z), distance, (nx, ny, nz, *_) in rows:
            link, body = (one, other) if one in self._links else (other, one)
            if link not in self._links or row < 0 or body in self._links:
                continue
            if not ground and self._bodies[body] == GROUND:
                continue
            names, depth = (self._links[link], self._bodies[body]), max(0.0, -distance)
            # The normal points from the first geom to the second.
            sign = -1.0 if link == one else 1.0
            normal = (sign * nx, sign * ny, sign * nz)
            yield Contact(time, *names, (x, y, z), float(forces[row]), depth=depth, normal_xyz=normal)

    def of_links(self) -> Iterator[LinkTouch]:
        """Yield the present contact points of links with bodies of the world and the ground."""
        contacts, forces = self._data.contact, self._data.efc_force
        columns = contacts.geom, contacts.efc_address, contacts.pos, contacts.frame
        for (one, other), row, (x, y, z), (nx, ny, nz, *_) in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            if row < 0 or (one in self._links) == (other in self._links):
                continue
            # The normal points from the first geom to the second.
            link, body, sign = (one, other, -1.0) if one in self._links else (other, one, 1.0)
            normal = (sign * nx, sign * ny, sign * nz)
            yield LinkTouch(self._links[link], self._bodies[body], (x, y, z), normal, float(forces[row]))

    def touching(self) -> Iterator[Overlap | Clash]:
        """See Engine.touching."""
        contacts = self._data.contact
        for (one, other), distance in zip(contacts.geom.tolist(), contacts.dist.tolist(), strict=True):
            link, body = (one, other) if one in self._links else (other, one)
            if link in self._links and body in self._links:
                continue
            if link in self._links:
                yield Overlap(self._links[link], self._bodies[body], -distance)
            else:
                yield Clash(self._bodies[link], self._bodies[body], -distance)

    def overlaps(self) -> tuple[Overlap, ...]:
        """See Engine.overlaps."""
        deepest: dict[tuple[str, str], float] = {}
        for one, other, depth in self._present():
            link, body = (one, other) if one in self._links else (other, one)
            if link in self._links and body not in self._links:
                pair = self._links[link], self._bodies[body]
                deepest[pair] = max(deepest.get(pair, 0.0), depth)
        return tuple(Overlap(link, body, depth) for (link, body), depth in deepest.items() if depth > 0)

    def clashes(self) -> tuple[Clash, ...]:
        """See Engine.clashes."""
        deepest: dict[tuple[str, str], float] = {}
        for one, other, depth in self._present():
            if one not in self._links and other not in self._links:
                body, fixed = (one, other) if self._moves(one) else (other, one)
                pair = self._bodies[body], self._bodies[fixed]
                deepest[pair] = max(deepest.get(pair, 0.0), depth)
        return tuple(Clash(body, other, depth) for (body, other), depth in deepest.items() if depth > 0)

    def _moves(self, geom: int) -> bool:
        return bool(self._model.body_dofnum[self._model.geom_bodyid[geom]])

    def _present(self) -> Iterator[tuple[int, int, float]]:
        """Yield the pairs of geoms that touch now, with their depth in m."""
        # The contacts in the data are those of the last step and influence the next, so a copy is used.
        present = self._compiled.spare_data()
        present.qpos[:] = self._data.qpos
        mujoco.mj_fwdPosition(self._model, present)
        found = list(zip(present.contact.geom.tolist(), present.contact.dist.tolist(), strict=True))
        self._compiled.give_back(present)
        for (one, other), distance in found:
            yield one, other, -distance
