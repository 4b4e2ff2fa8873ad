"""From a scene and what was kept of a run to its replay."""

from __future__ import annotations

from collections.abc import Sequence

from sim_action.recording.replay.contacts import joined, strongest
from sim_action.recording.replay.frames import Track, frames_of, thinned
from sim_action.recording.replay.marks import MarkData
from sim_action.recording.replay.models import MOST_LETTERS, Replay, SignalData
from sim_action.recording.replay.scenery import scenery
from sim_action.recording.replay.skeleton import skeleton
from sim_action.state.trace import Trace
from sim_action.world.scene import Scene


def replay_of(
    scene: Scene,
    film: Trace,
    signals: Sequence[SignalData] = (),
    marks: Sequence[MarkData] = (),
) -> Replay:
    """The replay of a run.

    Args:
        scene: what was simulated.
        film: what was seen of it, 30 moments a second.
        signals: what expectations looked at.
        marks: where they did.
    """
    moving = [body for body in scene.world.objects if body.name in film.bodies]
    _, links = skeleton(scene.model)
    bodies = {body.name: number for number, body in enumerate(scene.world.objects)}
    contacts, left_out = strongest(joined(film.contacts), links, bodies)
    joints = scene.model.moving_joints
    sliding = [joint.type == "prismatic" for joint in joints]
    tracks = [Track(film.bodies[body.name], body.appears or 0.0) for body in moving]
    return Replay(
        version=1,
        scene=scenery(scene, [body.name for body in moving]),
        joint_names=tuple(joint.name[:MOST_LETTERS] for joint in joints),
        frames=frames_of(thinned(film), tracks, scene.physics.rate, sliding),
        contacts=contacts,
        contacts_left_out=left_out,
        signals=tuple(signals),
        marks=tuple(marks),
    )
