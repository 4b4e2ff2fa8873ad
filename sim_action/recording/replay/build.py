"""Build the replay of a run: scene, frames, contacts, signals and marks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path

from pydantic import BaseModel

from sim_action.recording.replay import golden, marks, pictures, replay_data, scans, scene_data, shapes, sightings
from sim_action.recording.replay.channels import stored_channels
from sim_action.recording.replay.commanded_path import commanded_path
from sim_action.recording.replay.frames import NOTHING_COMMANDED, Track, frames_of, thinned
from sim_action.recording.replay.marks import MarkData
from sim_action.recording.replay.replay_data import Replay, SignalData
from sim_action.recording.replay.replay_file import write_replay
from sim_action.recording.replay.scene import scenery, skeleton
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH
from sim_action.recording.replay.signals import stored_golden, stored_marks, stored_signals
from sim_action.recording.replay.touches import joined_touches, strongest_touches
from sim_action.robot.model.robot_model import RobotModel
from sim_action.scenario.model import Scenario
from sim_action.sensors.reading_log import ReadingLog
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import CommandedValues
from sim_action.world.scene import Scene


def replay_of(
    scene: Scene,
    film: Trace,
    signals: Sequence[SignalData] = (),
    marks: Sequence[MarkData] = (),
    *,
    commanded: Mapping[str, CommandedValues] | None = None,
    readings: Mapping[str, ReadingLog] | None = None,
) -> Replay:
    """Return the replay of a run.

    Args:
        scene: the simulated scene.
        film: the trace at 30 Hz.
        signals: the signals of the expectations.
        marks: the places of the expectations.
        commanded: what was commanded, by kind; see `RunRecorder.commanded`.
        readings: the readings of sensors by name.
    """
    commanded, readings = commanded or {}, readings or {}
    moving = [body for body in scene.world.objects if body.name in film.bodies]
    _, links = skeleton(scene.model)
    bodies = {body.name: number for number, body in enumerate(scene.world.objects)}
    contacts, left_out = strongest_touches(joined_touches(film.contacts), links, bodies, scene.physics.rate)
    joints = scene.model.moving_joints
    sliding = [joint.type == "prismatic" for joint in joints]
    tracks = [Track(film.bodies[body.name], body.appears or 0.0) for body in moving]
    frames = thinned(film)
    return Replay(
        version=2,
        scene=scenery(scene, [body.name for body in moving]),
        joint_names=tuple(joint.name[:MAX_TEXT_LENGTH] for joint in joints),
        frames=frames_of(frames, tracks, scene.physics.rate, sliding, commanded.get("position", NOTHING_COMMANDED)),
        contacts=contacts,
        contacts_left_out=left_out,
        signals=tuple(signals),
        marks=tuple(marks),
        channels=stored_channels(scene, frames, film.contacts, commanded, readings),
        scans=scans.stored_scans(readings, links, scene.model.root, float(film.time[-1]), scene.physics.rate),
        cameras=pictures.stored_pictures(readings, float(film.time[-1])),
        obstacles=sightings.obstacles_of(scene, film, readings),
    )


def make_replay(
    scenario: Scenario,
    scene: Scene,
    start: Observation,
    film: Trace,
    path: Path,
    *,
    commanded: Mapping[str, CommandedValues] | None = None,
    readings: Mapping[str, ReadingLog] | None = None,
) -> None:
    """Write the replay of a run.

    `start` is the settled state at t = 0, `film` the trace at 30 Hz, `commanded` what was commanded, by kind, and
    `readings` are those of sensors by name.

    Raises OSError, or ValueError if the replay is too large or not valid.
    """
    signals, marks = stored_signals(scenario, scene, start, film), stored_marks(scenario, scene, start)
    replay = replay_of(scene, film, signals, marks, commanded=commanded, readings=readings)
    unread = [sensor.name for sensor in scenario.sensors if sensor.name not in (readings or {})]
    base = (commanded or {}).get("base")
    update = {
        "commanded_path": commanded_path(scenario, start, base, film.time),
        "unread": tuple(unread[: scans.MAX_SENSORS]),
        "scenario": scenario.name[:MAX_TEXT_LENGTH],
        "golden": stored_golden(scenario, scene),
    }
    write_replay(replay.model_copy(update=update), path)


def warm_up(robots: Iterable[RobotModel]) -> None:
    """Build the validators of all models and import the mesh readers once, before processes are forked."""
    for module in (shapes, golden, marks, scene_data, scans, pictures, sightings, replay_data):
        for model in vars(module).values():
            if isinstance(model, type) and issubclass(model, BaseModel):
                model.model_rebuild()
    if any(link.has_mesh for robot in robots for link in robot.links):
        import_module("sim_action.recording.replay.visual_meshes")
