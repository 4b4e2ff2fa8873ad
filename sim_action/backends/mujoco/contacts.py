"""What the robot touches, in names."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco

from sim_action.backends.mujoco.model import Compiled
from sim_action.observation import Clash, Contact, Overlap
from sim_action.world import GROUND


class Contacts:
    """Reads the contacts of the last step."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._links, self._bodies = compiled.links, compiled.bodies
        objects = {geom for geom, body in self._bodies.items() if body != GROUND}
        self._matters = objects.union(self._links)

    def of_step(self, time: float, *, ground: bool) -> Iterator[Contact]:
        """What touches now, with or without the ground."""
        if not self._data.ncon:
            return
        contacts = self._data.contact
        geoms = contacts.geom.tolist()
        # Of a few contacts, this is quicker without arrays.
        if not ground and not any((one in self._matters and other in self._matters) for one, other in geoms):
            return
        forces = self._data.efc_force
        pairs = zip(geoms, contacts.efc_address.tolist(), contacts.pos.tolist(), strict=True)
        for (one, other), row, (x, y, z) in pairs:
            link, body = (one, other) if one in self._links else (other, one)
            if link not in self._links or row < 0 or (not ground and self._bodies[body] == GROUND):
                continue
            yield Contact(time, self._links[link], self._bodies[body], (x, y, z), float(forces[row]))

    def overlaps(self) -> tuple[Overlap, ...]:
        """See Backend.overlaps."""
        deepest: dict[tuple[str, str], float] = {}
        for one, other, depth in self._present():
            link, body = (one, other) if one in self._links else (other, one)
            if link in self._links:
                pair = self._links[link], self._bodies[body]
                deepest[pair] = max(deepest.get(pair, 0.0), depth)
        return tuple(Overlap(link, body, depth) for (link, body), depth in deepest.items() if depth > 0)

    def clashes(self) -> tuple[Clash, ...]:
        """See Backend.clashes."""
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
        """Geoms that touch now, and how deep they are in each other in m."""
        # Contacts are those of the last step, and have a part in the next: present ones are looked for on a copy.
        present = mujoco.MjData(self._model)
        present.qpos[:] = self._data.qpos
        mujoco.mj_fwdPosition(self._model, present)
        for (one, other), distance in zip(present.contact.geom.tolist(), present.contact.dist.tolist(), strict=True):
            yield one, other, -distance
