"""Bodies of MuJoCo: their present poses, distances, contacts, overlaps and rays, and forces and motions for a step.

After a step MuJoCo's data hold the poses before it, so the queries recompute the kinematics first.

A body without a joint has no velocity in MuJoCo, even if its pose changes at every step. A contact constraint uses the
relative velocity v of the touching points only in its reference acceleration, -b v. The missing part of v is therefore
added there, between the two halves of a step: then friction carries what stands on such a body, and impacts push.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.engines.body_control import MAX_ATTRACTION_M, BodyControl, RobotInertia, Target, base_wrench
from sim_action.engines.mujoco.geoms import wxyz
from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.engines.observers import Nearest, ReadPoses, deepest
from sim_action.state.command import BasePush
from sim_action.state.observation import Clash, Contact, Overlap
from sim_action.state.trace_records import LinkTouch
from sim_action.world import GROUND


class Links:
    """Present poses and twists of the robot's links."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._data, self._name = compiled.model, compiled.data, compiled.name

    def pose(self, link: str) -> Pose:
        """Return the pose of a link's frame, world frame."""
        mujoco.mj_kinematics(self._model, self._data)
        body = self._number(link)
        px, py, pz = self._data.xpos[body].tolist()
        qw, qx, qy, qz = self._data.xquat[body].tolist()
        return Pose((px, py, pz), (qx, qy, qz, qw))

    def twist(self, link: str) -> Twist:
        """Return the twist of the origin of a link's frame, world frame."""
        for work_out in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            work_out(self._model, self._data)
        body = self._number(link)
        velocity = np.empty(6)
        # An XBODY is a body's own frame, a BODY the one at its centre of mass.
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
        wx, wy, wz, vx, vy, vz = velocity.tolist()
        return Twist((vx, vy, vz), (wx, wy, wz))

    def _number(self, link: str) -> int:
        return int(self._model.body(self._name(link)).id)


_IN_OUR_ORDER: Final = np.array([0, 1, 2, 4, 5, 6, 3])


class Objects:
    """Present poses of the bodies of the world, read from the joint positions, which are up to date after a step."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._numbers = {name: int(self._model.geom_bodyid[geom]) for geom, name in compiled.bodies.items()}
        # The frame of a robot is its base link.
        self._numbers |= {name: actor.base for name, actor in compiled.actors.items()}

    def number(self, name: str) -> int:
        """Return MuJoCo's number of a body."""
        return self._numbers[name]

    def at(self, name: str) -> list[float]:
        """Return position and unit quaternion (7,) of a body, the quaternion as w, x, y, z."""
        body = self._numbers[name]
        if self._model.body_dofnum[body]:
            start = self._model.jnt_qposadr[self._model.body_jntadr[body]]
            numbers: list[float] = self._data.qpos[start : start + 7].tolist()
            return numbers
        return [*self._model.body_pos[body].tolist(), *self._model.body_quat[body].tolist()]

    def pose(self, name: str) -> Pose:
        """Return the pose of a body's centre, world frame."""
        px, py, pz, qw, qx, qy, qz = self.at(name)
        return Pose((px, py, pz), (qx, qy, qz, qw))

    def pose_reader(self, names: Sequence[str]) -> ReadPoses:
        """Return a function that reads the poses of these bodies."""
        model, numbers = self._model, [self._numbers[name] for name in names]
        free = [place for place, body in enumerate(numbers) if model.body_dofnum[body]]
        fixed = [place for place, body in enumerate(numbers) if not model.body_dofnum[body]]
        starts = [model.jnt_qposadr[model.body_jntadr[numbers[place]]] for place in free]
        # MuJoCo orders quaternions as w, x, y, z.
        taken = np.add.outer(np.array(starts, dtype=np.intp), _IN_OUR_ORDER)
        held = np.array([numbers[place] for place in fixed], dtype=np.intp)

        def look() -> FloatArray:
            row = np.empty((len(names), 7))
            row[free] = self._data.qpos[taken]
            if fixed:
                row[fixed, :3], row[fixed, 3:] = model.body_pos[held], model.body_quat[held][:, _IN_OUR_ORDER[3:] - 3]
            return row.ravel()

        return look

    def set_pose(self, name: str, pose: Pose, twist: Twist) -> bool:
        """Set the pose of a body, and its twist if it can have one; return True if it can."""
        body = self._numbers[name]
        moves = bool(self._model.body_dofnum[body])
        if moves:
            start, first = self._model.jnt_qposadr[self._model.body_jntadr[body]], self._model.body_dofadr[body]
            self._data.qpos[start : start + 7] = *pose.position_xyz, *wxyz(pose.orientation_xyzw)
            # The engine has the angular velocity in the body's own frame, the linear one in the world's.
            turning = geometry.rotate(geometry.conjugate(pose.orientation_xyzw), twist.angular_xyz)
            self._data.qvel[first : first + 6] = *twist.linear_xyz, *turning
        else:
            self._model.body_pos[body], self._model.body_quat[body] = pose.position_xyz, wxyz(pose.orientation_xyzw)
        return moves


# Up to this many geoms, measuring all is faster than sorting out distant ones.
_MAX_SINGLE_QUERIES: Final = 8
_ANYWHERE_M: Final = 1e5


class Distances:
    """Measures distances between links and bodies of the world, at present or in a past state."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._present, self._data = compiled.model, compiled.data, compiled.data
        self._first_qpos, self._end_qpos = compiled.first_qpos, compiled.first_qpos + compiled.robot_qpos
        self._links, self._bodies = _by_name(compiled.links), _by_name(compiled.bodies)
        kinds = self._model.geom_type.tolist()
        self._fields = {geom for geom, kind in enumerate(kinds) if kind == mujoco.mjtGeom.mjGEOM_HFIELD}
        # MuJoCo gives a plane the radius 0; it is infinite.
        self._radii = [radius or math.inf for radius in self._model.geom_rbound.tolist()]
        self._body_radii = {
            name: np.array([self._radii[geom] for geom in geoms]) for name, geoms in self._bodies.items()
        }

    def look_at_present(self) -> None:
        """Let `near` measure the present state, until the next step."""
        self._data = self._present
        mujoco.mj_kinematics(self._model, self._data)

    def recall(self, robot_qpos: FloatArray) -> None:
        """Let `near` measure a past state of the robot (P,), with all bodies where they were at the first call."""
        self._data, qpos = self._past
        qpos[:] = robot_qpos
        mujoco.mj_kinematics(self._model, self._data)

    @cached_property
    def _past(self) -> tuple[Any, FloatArray]:
        past = mujoco.MjData(self._model)
        past.qpos[:] = self._present.qpos
        return past, past.qpos[self._first_qpos : self._end_qpos]

    def near(self, body: str, links: Collection[str] | None, within: float) -> dict[str, float]:
        """Return the distances of links to a body, as `LinkDistances` does."""
        distances = {}
        for link in self._links if links is None else links:
            distance = self._distance(link, body, within)
            if distance < within:
                distances[link] = distance
        return distances

    def nearest(self, body: str, links: Collection[str]) -> dict[str, Nearest]:
        """Return the nearest points of links to a body, as `NearestPoints` does."""
        self.look_at_present()
        if not self._fields.isdisjoint(self._bodies[body]):
            return self._nearest_collisions(body, links)
        nearest: dict[str, Nearest] = {}
        points = np.empty(6)
        for link in links:
            least = _ANYWHERE_M
            for geom, other in itertools.product(self._links[link], self._bodies[body]):
                distance = mujoco.mj_geomDistance(self._model, self._data, geom, other, least, points)
                if distance < least:
                    x, y, z = points[:3].tolist()
                    least, nearest[link] = distance, Nearest(distance, (x, y, z))
        return nearest

    def _nearest_collisions(self, body: str, links: Collection[str]) -> dict[str, Nearest]:
        """Return the same from the contacts: MuJoCo has no distances to heightfields. Without a contact it is 0."""
        data, others = self._past[0], self._bodies[body]
        data.qpos[:] = self._present.qpos
        mujoco.mj_fwdPosition(self._model, data)
        nearest = {link: Nearest(0.0, (0.0, 0.0, 0.0)) for link in links}
        owners = {geom: link for link in links for geom in self._links[link]}
        columns = data.contact.geom, data.contact.dist, data.contact.pos
        for pair, distance, (x, y, z) in zip(*(column.tolist() for column in columns), strict=True):
            link = next((owners[geom] for geom in pair if geom in owners), None)
            if link is not None and not set(others).isdisjoint(pair) and distance < nearest[link].distance:
                nearest[link] = Nearest(distance, (x, y, z))
        return nearest

    def radii(self) -> dict[str, float]:
        """Return link -> greatest distance in m of its shapes from its frame."""
        return {link: max(map(self._reach, geoms)) for link, geoms in self._links.items()}

    def _distance(self, link: str, body: str, within: float) -> float:
        least, model, data, others = within, self._model, self._data, self._bodies[body]
        few = len(others) <= _MAX_SINGLE_QUERIES
        for geom in self._links.get(link, ()):
            for other in others if few else self._near_enough(geom, body, least):
                distance = mujoco.mj_geomDistance(model, data, geom, other, least, None)
                least = min(least, distance)
        return least

    def _near_enough(self, geom: int, body: str, within: float) -> Iterable[int]:
        others, places = self._bodies[body], self._data.geom_xpos
        apart = np.sqrt(((places[others] - places[geom]) ** 2).sum(axis=1)) - self._body_radii[body]
        return [others[index] for index in np.flatnonzero(apart < within + self._radii[geom])]

    def _reach(self, geom: int) -> float:
        return math.hypot(*self._model.geom_pos[geom].tolist()) + self._radii[geom]


def _by_name(names: Mapping[int, str]) -> dict[str, list[int]]:
    """Return name -> geoms."""
    geoms: dict[str, list[int]] = {}
    for geom, name in names.items():
        geoms.setdefault(name, []).append(geom)
    return geoms


_Floats = NDArray[np.float64]

# Groups of geoms; rays hit only the first one.
_SEEN: Final = 0
_UNSEEN: Final = 1
_LOOK_FOR: Final = np.array([group == _SEEN for group in range(mujoco.mjNGROUP)], dtype=np.uint8)


class Rays:
    """Casts rays in the present state; costs nothing unless used."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._own_data: Any = None
        groups = self._model.geom_group
        groups[groups == _SEEN] = _UNSEEN
        groups[list(compiled.bodies)] = _SEEN
        # With several robots, each sees all but itself.
        self._is_one_of_many = bool(compiled.actors or compiled.prefix)
        self._own, self._others = list(compiled.links), list(compiled.bodies)

    def cast(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fraction of each ray at which it hits a surface, as `EngineQueries.cast_rays` does."""
        data = self._present()
        start = np.array(start_xyz)
        if self._is_one_of_many:
            self._model.geom_group[self._own], self._model.geom_group[self._others] = _UNSEEN, _SEEN
        ways = ends_xyz - start
        shares, around = _cast(self._model, data, start, ways)
        hidden: set[int] = set()
        while around:
            hidden |= around
            self._model.geom_group[list(hidden)] = _UNSEEN
            shares, around = _cast(self._model, data, start, ways)
        if hidden:
            self._model.geom_group[list(hidden)] = _SEEN
        return shares

    def _present(self) -> Any:
        """Return data with the present poses, computed on a copy so that the run does not change."""
        if self._own_data is None:
            self._own_data = mujoco.MjData(self._model)
        self._own_data.qpos[:] = self._data.qpos
        mujoco.mj_kinematics(self._model, self._own_data)
        return self._own_data


def _cast(model: Any, data: Any, start: _Floats, ways: _Floats) -> tuple[_Floats, set[int]]:
    """Return the free share of each ray, and the geoms that contain its start, which it hits from inside."""
    count = len(ways)
    shares = np.empty(count)
    normals = np.zeros(3 * count)
    geoms = np.empty(count, np.int32)
    fixed_too, no_body, anywhere = True, -1, mujoco.mjMAXVAL
    mujoco.mj_multiRay(
        model, data, start, ways.ravel(), _LOOK_FOR, fixed_too, no_body, geoms, shares, normals, count, anywhere
    )
    # Only hits have a normal, which points outwards.
    outward = np.einsum("ij,ij->i", normals.reshape(-1, 3), ways)
    around = set(geoms[outward > 0].tolist()) if outward.max() > 0 else set()
    # MuJoCo searches beyond the end of a ray, and returns -1 without a hit.
    shares[(shares < 0) | (shares > 1)] = np.inf
    return shares, around


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
        """Return True if something but the ground may be touched; `touching`: see `SlidingContacts`. For every step."""
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
        for touch, distance in self._points():
            if ground or touch.body != GROUND:
                place, depth = touch.position_xyz, max(0.0, -distance)
                yield Contact(
                    time, touch.link, touch.body, place, touch.force, depth=depth, normal_xyz=touch.normal_xyz
                )

    def of_links(self) -> Iterator[LinkTouch]:
        """Yield the present contact points of links with bodies of the world and the ground."""
        return (touch for touch, _ in self._points())

    def _points(self) -> Iterator[tuple[LinkTouch, float]]:
        """Yield the present contact points, each with the distance of the surfaces in m, negative inside."""
        contacts, forces = self._data.contact, self._data.efc_force
        columns = contacts.geom, contacts.efc_address, contacts.pos, contacts.dist, contacts.frame
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for (one, other), row, (x, y, z), distance, (nx, ny, nz, *_) in rows:
            if row < 0 or (one in self._links) == (other in self._links):
                continue
            # The normal points from the first geom to the second.
            link, body, sign = (one, other, -1.0) if one in self._links else (other, one, 1.0)
            normal = (sign * nx, sign * ny, sign * nz)
            yield LinkTouch(self._links[link], self._bodies[body], (x, y, z), normal, float(forces[row])), distance

    def touching(self) -> Iterator[Overlap | Clash]:
        """Yield the contacts of the last step, as `Engine.touching` does."""
        contacts = self._data.contact
        for (one, other), distance in zip(contacts.geom.tolist(), contacts.dist.tolist(), strict=True):
            link, body = (one, other) if one in self._links else (other, one)
            if link in self._links and body in self._links:
                continue
            if link in self._links:
                yield Overlap(self._links[link], self._bodies[body], -distance)
            elif self._bodies[link] != self._bodies[body] and (self._moves(link) or self._moves(body)):
                yield Clash(self._bodies[link], self._bodies[body], -distance)

    def overlaps(self) -> tuple[Overlap, ...]:
        """Return the links that now overlap bodies or the ground."""
        links = self._links
        pairs = ((one, other, depth) if one in links else (other, one, depth) for one, other, depth in self._present())
        met = ((link, body, depth) for link, body, depth in pairs if link in links and body not in links)
        return deepest(Overlap(links[link], self._bodies[body], depth) for link, body, depth in met)

    def clashes(self) -> tuple[Clash, ...]:
        """Return the bodies with a mass that now overlap others."""
        met = ((pair, depth) for *pair, depth in self._present() if self._links.keys().isdisjoint(pair))
        pairs = ((sorted(pair, key=self._moves, reverse=True), depth) for pair, depth in met)
        return deepest(
            Clash(self._bodies[body], self._bodies[other], depth)
            for (body, other), depth in pairs
            if self._moves(body) and self._bodies[body] != self._bodies[other]
        )

    def _moves(self, geom: int) -> bool:
        # The body that carries a welded one; 0 is the world.
        return bool(self._model.body_weldid[self._model.geom_bodyid[geom]])

    def _present(self) -> Iterator[tuple[int, int, float]]:
        """Yield the pairs of geoms that touch now, with their depth in m."""
        # The contacts in the data belong to the last step and influence the next, so a copy is used.
        present = self._compiled.spare_data()
        present.qpos[:] = self._data.qpos
        mujoco.mj_fwdPosition(self._model, present)
        contacts = list(zip(present.contact.geom.tolist(), present.contact.dist.tolist(), strict=True))
        self._compiled.give_back(present)
        for (one, other), distance in contacts:
            yield one, other, -distance


class MuJoCoBodyControl(BodyControl):
    """The bodies of a MuJoCo model."""

    def __init__(self, compiled: CompiledScene, objects: Objects, forget_frictions: Callable[[], None]) -> None:
        """`forget_frictions`: called when the friction of contacts has changed."""
        self._forget_frictions = forget_frictions
        self._model, self._data, self._objects = compiled.model, compiled.data, objects
        self._names, self._name = compiled.bodies, compiled.name
        self._moving: dict[str, Twist] = {}
        self._pressed: set[int] = set()

    @override
    def pose(self, body: str) -> Pose:
        return self._objects.pose(body)

    @override
    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        if self._objects.set_pose(body, pose, twist):
            return
        if twist == Twist():
            self._moving.pop(body, None)
        else:
            self._moving[body] = twist

    @override
    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        body = self._number(target)
        turning: Any = torque_xyz
        if point_xyz is not None:
            arm = np.subtract(point_xyz, self._model.body_ipos[body])
            mujoco.mj_kinematics(self._model, self._data)
            turned: NDArray[np.float64] = self._data.xmat[body].reshape(3, 3)
            turning = np.add(torque_xyz, np.cross(turned @ arm, force_xyz))
        # Other sources may act on the same body.
        self._data.xfrc_applied[body] += [*force_xyz, *turning]
        self._pressed.add(body)

    @override
    def attract(self, target: Target, force: float) -> None:
        body, data, owners = self._number(target), self._data, self._model.geom_bodyid
        touching: dict[int, list[Any]] = {}
        for contact in data.contact:
            one, other = owners[contact.geom].tolist()
            is_of_world = not self._names.keys().isdisjoint(contact.geom.tolist())
            if body in {one, other} and is_of_world and contact.dist < MAX_ATTRACTION_M:
                touching.setdefault(other if one == body else one, []).append(contact)
        for contacts in touching.values():
            for contact in contacts:
                # The normal points from the first geom to the second.
                pull = contact.frame[:3] * force / len(contacts)
                for number, pulled in zip(owners[contact.geom].tolist(), (pull, -pull), strict=True):
                    data.xfrc_applied[number, :3] += pulled
                    data.xfrc_applied[number, 3:] += np.cross(contact.pos - data.xipos[number], pulled)
                    self._pressed.add(number)

    @override
    def clear_forces(self) -> None:
        for body in self._pressed:
            self._data.xfrc_applied[body] = 0.0
        self._pressed.clear()

    @override
    def add_mass(self, link: str, mass: float) -> None:
        self._model.body_mass[self._number(Target(link, is_link=True))] += mass
        # It needs data of its own, because it moves the robot to its reference pose.
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))

    @override
    def scale_friction(self, patch: int, factor: float) -> None:
        model, tile = self._model, self._model.geom(f"{GROUND}/{patch}").id
        pairs = np.flatnonzero((model.pair_geom1 == tile) | (model.pair_geom2 == tile))
        # All coefficients of a pair are proportional to the coefficient of the ground.
        model.pair_friction[pairs] *= factor
        if not factor:
            model.pair_dim[pairs] = 1
        self._forget_frictions()

    @override
    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        first = int(self._model.body_dofadr[self._number(target)])
        self._data.qvel[first : first + 3] += velocity_xyz

    def carry(self) -> None:
        """Correct the contacts of moved bodies for their velocities, between the halves of a step."""
        if not self._moving or not self._data.ncon:
            return
        contacts = self._data.contact
        for number, geoms in enumerate(contacts.geom.tolist()):
            for geom, sign in zip(geoms, (1.0, -1.0), strict=True):
                twist = self._moving.get(self._names.get(geom, ""))
                if twist is not None and contacts.efc_address[number] >= 0:
                    contact = self._data.contact[number]
                    arm = np.subtract(contact.pos, self._data.xpos[self._model.geom_bodyid[geom]])
                    velocity = np.add(twist.linear_xyz, np.cross(twist.angular_xyz, arm))
                    along = contact.frame.reshape(3, 3)[: contact.dim] @ velocity
                    rows = slice(contact.efc_address, contact.efc_address + contact.dim)
                    self._data.efc_aref[rows] += sign * self._data.efc_KBIP[rows, 1] * along

    def _number(self, target: Target) -> int:
        return (
            int(self._model.body(self._name(target.name)).id) if target.is_link else self._objects.number(target.name)
        )


class BasePusher:
    """Applies the last push of the base at every step; a fixed base does not move."""

    def __init__(self, compiled: CompiledScene, rate: float) -> None:
        self._model, self._data, self._base = compiled.model, compiled.data, compiled.base
        self._time_step = 1 / rate
        # The inertia of the whole robot with its joints at their present positions.
        model, data, base = compiled.model, compiled.data, compiled.base
        inertia = 0.0
        for body in range(base, model.nbody):
            if base in _above(model.body_parentid, body):
                away = np.linalg.norm(data.xipos[body, :2] - data.xipos[base, :2])
                inertia += float(model.body_mass[body] * away**2 + model.body_inertia[body].min())
        self._robot = RobotInertia(float(model.body_subtreemass[base]), inertia)
        self._push: BasePush | None = None

    def apply(self, push: BasePush) -> None:
        """Use this push from now on."""
        self._push = push

    def step(self, pose: Pose, twist: Twist) -> None:
        """Set the force of the next step; `pose`, `twist`: of the base link's origin, world frame."""
        if self._push is None:
            return
        wrench = base_wrench(self._push, self._robot, pose, twist, self._time_step)
        # MuJoCo applies forces at the centre of mass of a body.
        x, y, z = self._model.body_ipos[self._base]
        arm = np.subtract(wrench.point_xyz, geometry.compose(pose, Pose((x, y, z))).position_xyz)
        self._data.xfrc_applied[self._base, :3] = wrench.force_xyz
        self._data.xfrc_applied[self._base, 3:] = np.add(wrench.torque_xyz, np.cross(arm, wrench.force_xyz))


def _above(parents: NDArray[np.int32], body: int) -> set[int]:
    """Return a body and all its ancestors."""
    bodies = {body}
    while body:
        body = int(parents[body])
        bodies.add(body)
    return bodies
