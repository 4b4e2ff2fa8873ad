"""Whether a replay's numbers point at what is there; a file may be a stranger's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from sim_action.recording.replay.shapes import MeshShape

if TYPE_CHECKING:
    from sim_action.recording.replay.models import Frames, Replay, SceneData, SignalData


def problem_of(replay: Replay) -> str | None:
    """The first thing that does not fit, if there is one."""
    return next(_problems(replay), None)


def _problems(replay: Replay) -> Iterator[str]:
    scene, frames = replay.scene, replay.frames
    yield from _of_links(scene, len(frames.joints))
    yield from _of_bodies(scene, len(frames.tracks))
    yield from _of_frames(frames)
    if len(replay.joint_names) != len(frames.joints):
        yield "there are as many joint names as columns of joints"
    if any(contact.link >= len(scene.links) or contact.body >= len(scene.bodies) for contact in replay.contacts):
        yield "a contact names a link or a body that is not there"
    if not all(_is_whole(signal, frames.count) for signal in replay.signals):
        yield "a signal has as many values as moments"


def _of_links(scene: SceneData, joints: int) -> Iterator[str]:
    for number, link in enumerate(scene.links):
        if (link.parent is None) != (number == 0) or (link.parent or 0) >= max(1, number):
            yield "the first link is the base, and each other one has a parent before it"
        if link.joint is not None and link.joint.column >= joints:
            yield "a link moves by a joint that has no column"


def _of_bodies(scene: SceneData, tracks: int) -> Iterator[str]:
    if any(body.track is not None and body.track >= tracks for body in scene.bodies):
        yield "a body moves on a track that is not there"
    drawn = [owner.shapes for owner in scene.links] + [owner.shapes for owner in scene.bodies]
    shapes = (shape for several in drawn for shape in several)
    if any(isinstance(shape, MeshShape) and shape.mesh not in scene.meshes for shape in shapes):
        yield "a shape names a mesh that is not there"
    if not all(mesh.is_whole for mesh in scene.meshes.values()):
        yield "a mesh has triangles between points that are not there"


def _of_frames(frames: Frames) -> Iterator[str]:
    if not all(column.fits(frames.count) for column in frames.columns):
        yield "a column has as many values as there are moments"
    if frames.time.gaps or any(delta <= 0 for delta in frames.time.deltas):
        yield "the time rises"


def _is_whole(signal: SignalData, frames: int) -> bool:
    if signal.time is None:
        return signal.values.fits(frames)
    rises = not signal.time.gaps and all(delta > 0 for delta in signal.time.deltas)
    return rises and signal.values.fits(1 + len(signal.time.deltas))
