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

An impact changes the slip within its step: a robot that hits a wall stops, while its wheels turn on. Such a step is
solved once more before, to know w.

Within a pair of shapes, differences of mu |w| are kept as far as they are small: an end of a wheel that slips more then
carries less. Two ends that carry 4 % more and less would otherwise turn on the spot about the one that carries more,
where a line of contact turns about its middle (measured: 1.4 % less yaw of the burger).
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from sim_action.engines.mujoco.contact_pairs import CONTACT_IMPEDANCE
from sim_action.engines.mujoco.scene import CompiledScene

_MAX_REMEMBERED_SETS: Final = 256
# Acceleration in m/s^2 that stops an approach, from which on a contact is an impact.
_MIN_IMPACT: Final = 5.0
# Share of its limit that the friction of a sliding contact has, after rounding.
_LIMIT_SHARE: Final = 0.99
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


class _Touching(NamedTuple):
    """A set of contacts; rows are counted from the end of all rows.

    Attributes:
        pairs: contacts with friction.
        first: the first row of all contacts.
        frictionless: rows of the normals of contacts without friction.
    """

    pairs: list[_Pair]
    first: int
    frictionless: list[int]


class SlidingContacts:
    """Corrects the reference accelerations of contacts between the two halves of each step."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._yields = math.hypot(*compiled.model.opt.gravity) * (1 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE
        # Touching geoms, and which of their contacts have no rows, as bytes -> their contacts. The order of contacts is
        # that of the geoms.
        self._known: dict[bytes, _Touching] = {}
        # Number of contacts -> live views of their geoms and of which have no rows, see `Contacts`.
        self._live: dict[int, tuple[memoryview, memoryview]] = {}

    def correct(self) -> None:
        """Lower the reference of the normal of each sliding contact; called after all changes of friction rows."""
        data = self._data
        count = data.ncon
        if not count:
            return
        if count not in self._live:
            self._live[count] = memoryview(data.contact.geom), memoryview(data.contact.exclude)
        geoms, excluded = self._live[count]
        touching = geoms.tobytes() + excluded.tobytes()
        found = self._known.get(touching) or self._find(touching)
        pairs, first, frictionless = found
        if not pairs:
            return
        references = data.efc_aref
        # Called at every step. For few numbers a list takes a fifth of the time of an array.
        values = references[first:].tolist()
        hits = False
        for row in frictionless:
            hits |= values[row] > _MIN_IMPACT
        for friction, yields, contacts in pairs:
            for row, row_x, row_y in contacts:
                normal, slip_x, slip_y = values[row], values[row_x], values[row_y]
                hits |= normal > _MIN_IMPACT
                least = yields / friction + (friction * normal if normal > 0.0 else 0.0)
                if slip_x * slip_x + slip_y * slip_y > least * least:
                    _lower(references, values, friction, _KEPT_SHARE * yields, contacts)
                    hits |= any(values[row] > _MIN_IMPACT for row, _, _ in contacts)
                    break
        if hits:
            self._correct_impact(references, values, pairs)

    def _correct_impact(self, references: Any, values: list[float], pairs: list[_Pair]) -> None:
        """Solve the step, and correct its references by the slip in it; `values`: the references before."""
        model, data = self._model, self._data
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        accelerations = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(model, data, accelerations, data.qacc)
        forces = data.efc_force
        for friction, _, contacts in pairs:
            for row, row_x, row_y in contacts:
                references[row] = values[row]
                if math.hypot(forces[row_x], forces[row_y]) > _LIMIT_SHARE * friction * forces[row]:
                    along_x, along_y = accelerations[row_x] - values[row_x], accelerations[row_y] - values[row_y]
                    references[row] -= friction * math.hypot(along_x, along_y)

    def _find(self, touching: bytes) -> _Touching:
        contacts, rows = self._data.contact, self._data.nefc
        pairs: dict[tuple[int, ...], _Pair] = {}
        firsts, dimensions = contacts.efc_address.tolist(), contacts.dim.tolist()
        frictions, geoms = contacts.friction[:, 0].tolist(), contacts.geom.tolist()
        frictionless = []
        for first, dimension, friction, pair in zip(firsts, dimensions, frictions, geoms, strict=True):
            row = first - rows
            if first >= 0 and dimension == _ROWS:
                known = pairs.setdefault(tuple(pair), _Pair(friction, self._yields / len(firsts), []))
                known.contacts.append((row, row + 1, row + 2))
            elif first >= 0:
                frictionless.append(row)
        if len(self._known) == _MAX_REMEMBERED_SETS:
            self._known.clear()
        active = [first for first in firsts if first >= 0]
        found = _Touching(list(pairs.values()), min(active, default=rows) - rows, frictionless)
        self._known[touching] = found
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
