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
import struct
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided

from sim_action.core.records import dataclass
from sim_action.engines.mujoco.geoms import CONTACT_IMPEDANCE
from sim_action.engines.mujoco.scene import CompiledScene

_MAX_REMEMBERED_SETS: Final = 256
_MIN_IMPACT: Final = 5.0  # acceleration in m/s^2 that stops an approach, from which on a contact is an impact
_LIMIT_SHARE: Final = 0.99  # share of its limit that the friction of a sliding contact has, after rounding
_ROUNDING: Final = 1e-9  # far more than the rounding errors of accelerations near these limits, in m/s^2
_ROWS: Final = 3  # rows of a contact with friction: normal, and two directions along the surface

# Largest kept difference within a pair, as a share of the acceleration by which a contact at rest yields to its weight.
_KEPT_SHARE: Final = 0.2
_TURNING_SHARE: Final = 0.5  # a pair turns on the spot if its mean slip is smaller than this share of its slips
_Rows = tuple[int, int, int]  # rows of a contact, counted from the end of all rows


class _Pair(NamedTuple):
    """Two touching shapes."""

    friction: float
    # acceleration in m/s^2 by which a contact at rest yields to the weight on it. If mu |w| is smaller, the contact
    # stays closed without a correction.
    yields: float
    contacts: list[_Rows]
    group: int = 0  # number of the group of robots that touch each other; what one does changes nothing of another


@dataclass(slots=True)
class _Touching:
    """A set of contacts; rows are counted from the end of all rows."""

    pairs: list[_Pair]  # contacts with friction
    normals: list[int]  # rows of the normals of all contacts
    groups: list[int]  # the group of each of them
    # returns the references of these rows, given a view of all and `first_byte`
    read: Callable[[memoryview[float], int], tuple[float, ...]]
    first_byte: int  # where the rows begin, counted from the end of the view
    calm: tuple[float, ...]  # references at which nothing slides or hits
    calm_within: float  # nothing does so either at references that are nearer to `calm`, as vectors

    def settle(self, values: tuple[float, ...]) -> None:
        """Use these references as `calm`: nothing slides or hits at them."""
        margins = [_MIN_IMPACT - values[row] for row in self.normals]
        for friction, yields, contacts, _ in self.pairs:
            for row, row_x, row_y in contacts:
                room = _least_slip(friction, yields, values[row]) - math.hypot(values[row_x], values[row_y])
                # The least slip changes by the friction times the change of the normal.
                margins.append(room / math.hypot(1.0, friction))
        self.calm, self.calm_within = values, min(margins) - _ROUNDING


_NOTHING: Final = _Touching([], [], [], lambda _references, _first: (), 0, (), math.inf)


class SlidingContacts:
    """Corrects the reference accelerations of contacts between the two halves of each step."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._yields = math.hypot(*compiled.model.opt.gravity) * (1 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE
        # The touching geoms of the last step, and which of their contacts have no rows; empty without contacts.
        self.touching = b""
        actors = enumerate(compiled.actors.values(), start=1)
        # Geom of another robot -> the number of the robot; and the geoms that never move.
        self._robots = {geom: number for number, actor in actors for geom in actor.links}
        self._fixed = set(np.flatnonzero(compiled.model.body_weldid[compiled.model.geom_bodyid] == 0).tolist())
        # `touching` -> the contacts. The contacts have the order of the geoms.
        self._known: dict[bytes, _Touching] = {}
        # Number of contacts -> a live view of their geoms and of which have no rows.
        self._live: dict[int, memoryview] = {}
        # `correct` lowers the reference of the normal of each sliding contact, given a live view of `efc_aref`, after
        # all changes of friction rows; `forget` makes it look up the friction of all contacts again.
        self.correct, self.forget = self._corrector()

    def _corrector(self) -> tuple[Callable[[memoryview[float]], None], Callable[[], None]]:
        """Return the functions `correct` and `forget`."""
        # Called at every step: variables of a function are read faster than attributes.
        data, live_view, remembered, distance = self._data, self._live.get, self._known.get, math.dist
        touching, contact_set = b"", _NOTHING

        def correct(references: memoryview[float]) -> None:
            nonlocal touching, contact_set
            count = data.ncon
            if not count:
                self.touching = touching = b""
                return
            # MuJoCo keeps contacts at a fixed address, and looking that up takes five times as long as reading them.
            now = (live_view(count) or self._view(count)).tobytes()
            if now != touching:
                self.touching = touching = now
                contact_set = remembered(now) or self._find(now)
            # For few numbers a tuple takes a fifth of the time of an array.
            values = contact_set.read(references, contact_set.first_byte)
            # Most steps are like the one before: then a single call shows that there is nothing to correct.
            if not distance(values, contact_set.calm) < contact_set.calm_within and not self._correct_some(
                references, values, contact_set
            ):
                contact_set.settle(values)

        def forget() -> None:
            nonlocal touching
            self._known.clear()
            touching = b""

        return correct, forget

    def _correct_some(self, references: memoryview[float], values: tuple[float, ...], contact_set: _Touching) -> bool:
        """Correct the contacts; return True if one slides or hits. `values`: the references of their rows."""
        slides = False
        for friction, yields, contacts, _ in contact_set.pairs:
            for row, row_x, row_y in contacts:
                slip_x, slip_y = values[row_x], values[row_y]
                least = _least_slip(friction, yields, values[row])
                if slip_x * slip_x + slip_y * slip_y > least * least:
                    slides = True
                    _lower(references, values, friction, _KEPT_SHARE * yields, contacts)
                    break
        hit = {
            group
            for row, group in zip(contact_set.normals, contact_set.groups, strict=True)
            if values[row] > _MIN_IMPACT
        }
        if hit:
            self._correct_impact(references, values, [pair for pair in contact_set.pairs if pair.group in hit])
        return slides or bool(hit)

    def _correct_impact(self, references: memoryview[float], values: tuple[float, ...], pairs: list[_Pair]) -> None:
        """Solve the step, and correct its references by the slip in it; `values`: the references before."""
        model, data = self._model, self._data
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        accelerations = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(model, data, accelerations, data.qacc)
        forces = data.efc_force
        for friction, _, contacts, _ in pairs:
            for row, row_x, row_y in contacts:
                references[row] = values[row]
                if math.hypot(forces[row_x], forces[row_y]) > _LIMIT_SHARE * friction * forces[row]:
                    along_x, along_y = accelerations[row_x] - values[row_x], accelerations[row_y] - values[row_y]
                    references[row] -= friction * math.hypot(along_x, along_y)

    def _view(self, count: int) -> memoryview:
        """Return a live view of the part of each contact from its geoms to `exclude`: one view is read faster."""
        geoms, excluded = self._data.contact.geom, self._data.contact.exclude
        size = _address(excluded) + excluded.itemsize - _address(geoms)
        numbers: Any = as_strided(geoms, (count, size // geoms.itemsize), geoms.strides)
        view = self._live[count] = memoryview(numbers.view(f"V{size}")[:, 0])
        return view

    def _groups_of(self, pairs: list[list[int]]) -> list[int]:
        """Return the group of each contact; robots that touch each other, and what they touch, are in one group."""
        if not self._robots:
            return [0] * len(pairs)
        # The robot under test, with all that is no other robot, is number 0; fixed geoms join nothing.
        members = [{self._robots.get(geom, 0) for geom in pair if geom not in self._fixed} or {0} for pair in pairs]
        leader = {number: number for several in members for number in several}
        for several in members:
            low = min(leader[number] for number in several)
            joined = {leader[number] for number in several}
            leader = {number: low if now in joined else now for number, now in leader.items()}
        return [leader[min(several)] for several in members]

    def _find(self, touching: bytes) -> _Touching:
        contacts, rows = self._data.contact, self._data.nefc
        pairs: dict[tuple[int, ...], _Pair] = {}
        firsts = contacts.efc_address.tolist()
        geoms = contacts.geom.tolist()
        groups = self._groups_of(geoms)
        normals, normal_groups = [], []
        columns = zip(firsts, contacts.dim.tolist(), contacts.friction[:, 0].tolist(), geoms, groups, strict=True)
        for first, dimension, friction, pair, group in columns:
            row = first - rows
            # A contact that holds by adhesion has fewer rows while it is open.
            if first >= 0 and dimension == _ROWS and not self._model.flg_adhesion:
                geom_pair = pairs.setdefault(
                    tuple(pair), _Pair(friction, self._yields / groups.count(group), [], group)
                )
                geom_pair.contacts.append((row, row + 1, row + 2))
            if first >= 0:
                normals.append(row)
                normal_groups.append(group)
        if len(self._known) == _MAX_REMEMBERED_SETS:
            self._known.clear()
        # Contacts without friction never slide.
        count = rows - min(first for first in firsts if first >= 0) if pairs else 0
        read = struct.Struct(f"{count}d")
        contact_set = _Touching(
            list(pairs.values()), normals, normal_groups, read.unpack_from, -read.size, (math.inf,) * count, 0.0
        )
        if not pairs:
            contact_set.calm_within = math.inf
        self._known[touching] = contact_set
        return contact_set


def _address(array: Any) -> int:
    address: int = array.__array_interface__["data"][0]
    return address


def _least_slip(friction: float, yields: float, normal: float) -> float:
    return yields / friction + (friction * normal if normal > 0.0 else 0.0)


def _lower(
    references: memoryview[float], values: tuple[float, ...], friction: float, kept: float, contacts: list[_Rows]
) -> None:
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
            slides -= friction * normal
        parting.append(friction * slides if slides > 0.0 else 0.0)
    mean = sum(parting) / len(parting)
    if math.hypot(total_x, total_y) < _TURNING_SHARE * total:
        kept = math.inf
    for (row, _, _), own_parting in zip(contacts, parting, strict=True):
        difference = own_parting - mean
        if difference > kept:
            difference = kept
        elif difference < -kept:
            difference = -kept
        references[row] = values[row] - own_parting + difference
