"""What happens in the world at its time, whatever the engine: bodies on paths, bodies that appear, disturbances.

Before t = 0, while the robot settles, bodies wait where their paths begin, and nothing else happens.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol, Self

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.core.units import first_step
from sim_action.engines.body_control import Stage, Target
from sim_action.world import Body, Disturbance
from sim_action.world.body_path import PosePath
from sim_action.world.scene import Scene

_AT_REST: Final = Twist()
# In m: from there, nothing is seen or touched. Each body that is not there yet has a place of its own.
_AWAY: Final = 1e6


class _Mover(Protocol):
    def reach(self, step: int) -> None:
        """Puts its body where it is at a step."""


class Timetable:
    """All that happens in one scene; the engine tells it the steps, in their order."""

    def __init__(self, stage: Stage, movers: Sequence[_Mover], disturbances: Sequence[_Acting]) -> None:
        self._stage, self._movers, self._disturbances = stage, movers, disturbances
        self._reached: int | None = None
        self.after(-1)

    @classmethod
    def of(cls, scene: Scene, stage: Stage) -> Self | None:
        """None if nothing ever happens. All bodies are where they begin."""
        rate, objects = scene.physics.rate, scene.world.objects
        travels = [_Travel(stage, body, rate) for body in objects if body.path]
        absent = [body for body in objects if body.appears is not None]
        movers: list[_Mover] = [
            *travels,
            *(_Absence(stage, body, rate, number) for number, body in enumerate(absent, start=1)),
        ]
        disturbances = [_Acting(disturbance, scene) for disturbance in scene.world.disturbances]
        return cls(stage, movers, disturbances) if movers or disturbances else None

    def before(self, step: int) -> None:
        """What acts from this step to the next; every body is where it is at this step."""
        if self._reached != step:
            self._reach(step)
        for disturbance in self._disturbances:
            if disturbance.first <= step < disturbance.last:
                disturbance.act(step, self._stage)

    def after(self, step: int) -> None:
        """This step has come: forces end, and bodies are where they are then."""
        if self._disturbances:
            self._stage.release()
        self._reach(step)

    def _reach(self, step: int) -> None:
        self._reached = step
        for mover in self._movers:
            mover.reach(step)


class _Travel:
    """A body on its path."""

    def __init__(self, stage: Stage, body: Body, rate: float) -> None:
        self._stage, self._name, self._rate = stage, body.name, rate
        # Only the engine knows how high a body's middle is that stands on the ground.
        height = stage.pose(body.name).position_xyz[2]
        self._path = PosePath.of(body.pose.model_copy(update={"z": height}), body.path, loops=body.loop)
        self._ahead = -1, self._path.pose(0.0)
        self._rests = False

    def reach(self, step: int) -> None:
        """See _Mover.reach."""
        known, pose = self._ahead
        here = pose if known == step else self._path.pose(step / self._rate)
        ahead = self._path.pose((step + 1) / self._rate)
        self._ahead = step + 1, ahead
        if here == ahead and self._rests:
            return
        self._rests = here == ahead
        self._stage.put(self._name, here, geometry.twist_between(here, ahead, 1 / self._rate))


class _Absence:
    """A body that is not there before its time."""

    def __init__(self, stage: Stage, body: Body, rate: float, number: int) -> None:
        assert body.appears is not None
        self._stage, self._name, self._first = stage, body.name, first_step(body.appears, rate)
        self._pose = stage.pose(body.name)
        x, y, _ = self._pose.position_xyz
        self._away = Pose((x, y, number * _AWAY), self._pose.orientation_xyzw)
        self._is_there = False

    def reach(self, step: int) -> None:
        """See _Mover.reach."""
        if not self._is_there:
            self._is_there = step >= self._first
            self._stage.put(self._name, self._pose if self._is_there else self._away, _AT_REST)


class _Acting:
    """A disturbance in steps: from `first`, to before `last`."""

    def __init__(self, disturbance: Disturbance, scene: Scene) -> None:
        self._disturbance, self._rate = disturbance, scene.physics.rate
        name = disturbance.body or disturbance.link or scene.model.root
        self._target = Target(name, is_link=disturbance.body is None)
        pushes = disturbance.velocity is not None
        self.first = first_step(disturbance.at, self._rate) if pushes else int(disturbance.at * self._rate)
        self.last = self.first + 1 if pushes else first_step(disturbance.end, self._rate)

    def act(self, step: int, stage: Stage) -> None:
        """From this step to the next."""
        told = self._disturbance
        if told.velocity is not None:
            stage.push(self._target, told.velocity)
            return
        share = self._share(step)
        force, torque = (_scaled(vector or geometry.ZERO, share) for vector in (told.force, told.torque))
        stage.press(self._target, force, torque, told.point)

    def _share(self, step: int) -> float:
        """Of a step, the part in which it acts: times between steps count as much as others."""
        begins, ends = self._disturbance.at * self._rate, self._disturbance.end * self._rate
        return max(0.0, min(ends, step + 1.0) - max(begins, float(step)))


def _scaled(vector: geometry.Vector3, factor: float) -> geometry.Vector3:
    x, y, z = vector
    return (x * factor, y * factor, z * factor)
