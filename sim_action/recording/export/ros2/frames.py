"""The names of coordinate frames, as REP 105 has them: map, odom, and the robot's own links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sim_action.recording.export.recorded_run import RecordedRun


@dataclass(frozen=True, slots=True)
class Frames:
    """No two are alike: what is called as a link is gets another name.

    Attributes:
        map: of the world.
        odom: where the robot believes to have begun.
        base: the robot's base link, as its model calls it.
        bodies: name of a body of the world -> its frame.
        sensors: name of a sensor -> its frame.
    """

    map: str
    odom: str
    base: str
    bodies: Mapping[str, str]
    sensors: Mapping[str, str]

    @classmethod
    def of(cls, run: RecordedRun) -> Frames:
        """Those of a run."""
        model = run.scene.model
        taken = {link.name for link in model.links}

        def free(name: str) -> str:
            while name in taken:
                name += "_"
            taken.add(name)
            return name

        return cls(
            free("map"),
            free("odom"),
            model.root,
            {body.name: free(body.name) for body in run.scene.world.objects},
            {mounted.name: free(mounted.name) for mounted in run.sensors},
        )
