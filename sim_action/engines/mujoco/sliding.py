"""Sliding contacts in MuJoCo: removes the speed at which the solver would separate the surfaces.

MuJoCo's contact forces solve a convex problem (Todorov, "Convex and analytically-invertible dynamics with contacts and
constraints", 2014). In its solution a contact that slides also separates: if w is the difference in m/s^2 between its
tangential acceleration and the reference of its friction rows, its normal acceleration is mu |w| above the reference of
its normal row. Real surfaces do not separate. A box at friction 0.5 that was shoved at 4 m/s jumped by 100 mm, and a
caster that was dragged made its robot hop, so that the wheels lost grip. With mu |w| subtracted from the reference of
the normal row, Coulomb's law follows (de Saxce and Feng, "The bipotential method", 1998).

The reference of friction rows is -b v, with the slip speed v. Stopping an approach presses the surfaces together, which
lets friction take its part of |w|; a contact that sticks has no w. An estimate of |w| that is too high only lets
surfaces sink into each other by fractions of a millimetre.

Within a pair of shapes, differences of mu |w| are kept as far as they are small: an end of a wheel that slips more then
carries less. Two ends that carry 4 % more and less would otherwise turn on the spot about the one that carries more,
where a line of contact turns about its middle (measured: 1.4 % less yaw of the burger).
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from sim_action.engines.mujoco.contact_pairs import CONTACT_IMPEDANCE
from sim_action.engines.mujoco.scene import CompiledScene

_MAX_REMEMBERED_SETS: Final = 256
# Rows of a contact with friction: normal, and two directions along the surface.
_ROWS: Final = 3

# Largest kept difference within a pair, as a share of the acceleration by which a contact at rest yields to its weight.
_KEPT_SHARE: Final = 0.2
# A pair turns on the spot if its mean slip is smaller than this share of its slips.
_TURNING_SHARE: Final = 0.5

# Rows of a contact, counted from the end of all rows.
_Rows = tuple[int, int, int]


class _Pair(NamedTuple):
    """Two touching shapes.

    Attributes:
        yields: acceleration in m/s^2 by which a contact at rest yields to the weight on it. If mu |w| is smaller, the
            contact stays closed without a correction.
    """

    friction: float
    yields: float
    contacts: list[_Rows]


class SlidingContacts:
    """Corrects the reference accelerations of contacts between the two halves of each step."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._data = compiled.data
        self._yields = math.hypot(*compiled.model.opt.gravity) * (1 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE
        # Touching geoms, as bytes -> their pairs. The order of contacts is that of the geoms.
        self._known: dict[bytes, list[_Pair]] = {}
        # Number of contacts -> live view of their geoms, see `Contacts`.
        self._geoms: dict[int, memoryview] = {}

    def correct(self) -> None:
        """Lower the reference of the normal of each sliding contact; called after all changes of friction rows."""
        data = self._data
        count = data.ncon
        if not count:
            return
        if count not in self._geoms:
            self._geoms[count] = memoryview(data.contact.geom)
        touching = self._geoms[count].tobytes()
        found = self._known.get(touching)
        if found is None:
            found = self._find(touching)
        if not found:
            return
        references = data.efc_aref
        # Called at every step. For few numbers a list takes a fifth of the time of an array.
        values = references[found[0].contacts[0][0] :].tolist()
        for friction, yields, contacts in found:
            for row, row_x, row_y in contacts:
                normal, slip_x, slip_y = values[row], values[row_x], values[row_y]
                least = yields / friction + (friction * normal if normal > 0.0 else 0.0)
                if slip_x * slip_x + slip_y * slip_y > least * least:
                    _lower(references, values, friction, _KEPT_SHARE * yields, contacts)
                    break

    def _find(self, touching: bytes) -> list[_Pair]:
        contacts, rows = self._data.contact, self._data.nefc
        pairs: dict[tuple[int, ...], _Pair] = {}
        firsts, dimensions = contacts.efc_address.tolist(), contacts.dim.tolist()
        frictions, geoms = contacts.friction[:, 0].tolist(), contacts.geom.tolist()
        for first, dimension, friction, pair in zip(firsts, dimensions, frictions, geoms, strict=True):
            if dimension == _ROWS and first >= 0:
                known = pairs.setdefault(tuple(pair), _Pair(friction, self._yields / len(firsts), []))
                known.contacts.append((first - rows, first - rows + 1, first - rows + 2))
        if len(self._known) == _MAX_REMEMBERED_SETS:
            self._known.clear()
        self._known[touching] = found = list(pairs.values())
        return found


def _lower(references: Any, values: list[float], friction: float, kept: float, contacts: list[_Rows]) -> None:
    """Lower the references of the normals of a pair in which a contact slides.

    `kept`: largest kept difference in m/s^2. If the pair turns on the spot rather than slides, all of it is kept.
    """
    parting = []
    total_x = total_y = total = 0.0
    for row, row_x, row_y in contacts:
        slip_x, slip_y, normal = values[row_x], values[row_y], values[row]
        slides = math.sqrt(slip_x * slip_x + slip_y * slip_y)
        total_x, total_y, total = total_x + slip_x, total_y + slip_y, total + slides
        if normal > 0.0:
            slides = max(0.0, slides - friction * normal)
        parting.append(friction * slides)
    mean = sum(parting) / len(parting)
    if math.hypot(total_x, total_y) < _TURNING_SHARE * total:
        kept = math.inf
    for (row, _, _), here in zip(contacts, parting, strict=True):
        references[row] = values[row] - here + min(max(here - mean, -kept), kept)
