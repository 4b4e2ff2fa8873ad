"""Build the replay of a run: frames, contacts, the curves and marks of expectations, and the commanded path."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import BaseModel

from sim_action.assertions.monitors import FORCE_WINDOW_S
from sim_action.core import geometry
from sim_action.core.errors import InvalidPart
from sim_action.core.geometry import ZERO, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay import replay_data, scene_data, sensor_data, sightings
from sim_action.recording.replay.channels import stored_channels
from sim_action.recording.replay.columns import MAX_MOMENTS, Column, FloatArray, fine_scale, steady
from sim_action.recording.replay.replay_data import (
    MAX_CONTACTS,
    MAX_GOLDEN,
    MAX_SIGNALS,
    ContactData,
    EventData,
    Frames,
    GoldenData,
    PoseColumns,
    Replay,
    SignalData,
    write_replay,
)
from sim_action.recording.replay.scene_data import (
    MAX_ABS_VALUE,
    MAX_MARKS,
    MAX_TEXT_LENGTH,
    ArrowMark,
    CircleMark,
    MarkData,
    Place,
    PolygonMark,
    PolylineMark,
    numbers,
)
from sim_action.recording.replay.scenery import actor_links, scenery, skeleton
from sim_action.robot.model.robot_model import RobotModel
from sim_action.scenario.model import Scenario
from sim_action.sensors import ReadingLog
from sim_action.simulation.recorder import TWIST_NAMES
from sim_action.state.observation import Contact, Observation
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.state.trace_records import FRAME_RATE, BodyRecord, CommandedValues
from sim_action.state.verdict import Circle, Mark, Polygon, Polyline, Signal
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
    of_actors = actor_links(scene)
    bodies = {name: number for number, name in enumerate((*(body.name for body in scene.world.objects), *of_actors))}
    # A touched robot is drawn as its first link with a shape.
    for name in reversed(of_actors):
        bodies[name.partition("/")[0]] = bodies[name]
    contacts, left_out = strongest_touches(joined_touches(film.contacts), links, bodies, scene.physics.rate)
    joints = scene.model.moving_joints
    sliding = [joint.type == "prismatic" for joint in joints]
    tracks = [Track(film.bodies[body.name], body.appears or 0.0, body.disappears) for body in moving]
    followed = [name for name in of_actors if name in film.bodies]
    tracks += (Track(film.bodies[name], 0.0, None) for name in followed)
    frames = thinned(film)
    return Replay(
        version=2,
        scene=scenery(scene, [*(body.name for body in moving), *followed]),
        joint_names=tuple(joint.name[:MAX_TEXT_LENGTH] for joint in joints),
        frames=frames_of(frames, tracks, scene.physics.rate, sliding, commanded.get("position", NOTHING_COMMANDED)),
        contacts=contacts,
        contacts_left_out=left_out,
        signals=tuple(signals),
        marks=tuple(marks),
        channels=stored_channels(scene, frames, film.contacts, commanded, readings),
        scans=sensor_data.stored_scans(readings, links, scene.model.root, float(film.time[-1]), scene.physics.rate),
        cameras=sensor_data.stored_pictures(readings, float(film.time[-1])),
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
    events: Sequence[TimeMark] = (),
) -> None:
    """Write the replay of a run.

    `start` is the settled state at t = 0, `film` the trace at 30 Hz, `commanded` the commanded values by kind,
    `readings` the readings of sensors by name, and `events` the marks of the timeline.

    Raises OSError, or ValueError if the replay is too large or not valid.
    """
    signals = stored_signals(scenario, scene, start, film)
    marks = stored_marks(scenario, scene, start)
    replay = replay_of(scene, film, signals, marks, commanded=commanded, readings=readings)
    unread = [sensor.name for sensor in scenario.sensors if sensor.name not in (readings or {})]
    base = (commanded or {}).get("base")
    update = {
        "commanded_path": commanded_path(scenario, start, base, film.time),
        "unread": tuple(unread[: sensor_data.MAX_SENSORS]),
        "events": stored_events(events),
        "scenario": scenario.name[:MAX_TEXT_LENGTH],
        "golden": stored_golden(scenario, scene),
    }
    write_replay(replay.model_copy(update=update), path)


def warm_up(robots: Iterable[RobotModel]) -> None:
    """Build the validators of all models and import the mesh readers once, before processes are forked."""
    for module in (scene_data, sensor_data, sightings, replay_data):
        for model in vars(module).values():
            if isinstance(model, type) and issubclass(model, BaseModel):
                model.model_rebuild()
    if any(link.has_mesh for robot in robots for link in robot.links):
        import_module("sim_action.recording.replay.visual_meshes")


MAX_PATH_POINTS: Final = 1_000


def commanded_path(
    scenario: Scenario, start: Observation, twists: CommandedValues | None, time: FloatArray
) -> tuple[Place, ...]:
    """Return the commanded path of the base from `start`, with `twists` in its frame at `time` (T,); or empty."""
    if twists is None or len(time) < 2:
        return ()
    if route := [place for source in scenario.commands for place in source.stated_path]:
        points = np.array([start.pose.position_xyz[:2], *route])
    else:
        points = _led(start, twists, time)
    # The first call of np.unique would take 10 ms: it imports masked arrays.
    kept = points[np.linspace(0, len(points) - 1, min(len(points), MAX_PATH_POINTS)).round().astype(np.intp)]
    if not np.isfinite(kept).all() or np.abs(kept).max() > MAX_ABS_VALUE:
        return ()
    height = numbers(start.pose.position_xyz)[2]
    return tuple((round(x, 5), round(y, 5), height) for x, y in kept.tolist())


def _led(start: Observation, twists: CommandedValues, time: FloatArray) -> FloatArray:
    """Return the points (T, 2) to which the twists lead without slip and delay, on level ground."""
    ahead, left, turn = (np.nan_to_num(twists.at(TWIST_NAMES[place], time[:-1])) for place in (0, 1, 5))
    step = np.diff(time)
    yaw = start.pose.yaw + np.concatenate(([0.0], np.cumsum(turn * step)))
    # The heading half way is exact to second order.
    half = (yaw[1:] + yaw[:-1]) / 2
    moved = np.column_stack((ahead * np.cos(half) - left * np.sin(half), ahead * np.sin(half) + left * np.cos(half)))
    x, y, _ = start.pose.position_xyz
    led: FloatArray = np.vstack((np.zeros(2), np.cumsum(moved * step[:, None], axis=0))) + np.array((x, y))
    return led


# The resolution of columns: lengths in m, quaternions, joints in rad (sliding ones in m), speed in m/s.
_LENGTH: Final = 1e-4
_TURN: Final = 1e-4
_JOINT: Final = 1e-3
_SLIDING: Final = 1e-4
_SPEED: Final = 1e-3
NOTHING_COMMANDED: Final = CommandedValues()


def thinned(trace: Trace) -> Trace:
    """Return a trace with at most `MAX_MOMENTS` evenly spaced moments, including the last one."""
    if len(trace) <= MAX_MOMENTS:
        return trace
    return trace.rows(np.linspace(0, len(trace) - 1, MAX_MOMENTS).round().astype(np.intp))


@dataclass(frozen=True, slots=True)
class Track:
    """A moving body, whose record is valid from `appears` to `disappears`, in s."""

    record: BodyRecord
    appears: float = 0.0
    disappears: float | None = None


def frames_of(
    trace: Trace,
    tracks: Sequence[Track],
    rate: float,
    sliding: Sequence[bool],
    aims: CommandedValues = NOTHING_COMMANDED,
) -> Frames:
    """Return the frames of a trace and of moving bodies at `rate` Hz; `sliding`: prismatic joints; `aims`: commands."""
    steps = [_SLIDING if slides else _JOINT for slides in sliding]
    targets = [aims.at(name, trace.time) for name in trace.joint_names]
    columns = [
        Column.encoded(values, step) if np.isfinite(values).any() else None
        for values, step in zip(targets, steps, strict=True)
    ]
    return Frames(
        time=Column.encoded(trace.time, 1 / rate),
        base=_pose_columns(trace.base_position_xyz, trace.base_orientation_xyzw),
        joints=tuple(Column.encoded(column, step) for column, step in zip(trace.joint_position.T, steps, strict=True)),
        commanded=tuple(columns) if any(columns) else (),
        speed=Column.encoded(trace.speed, _SPEED),
        tilt=Column.encoded(trace.tilt, _JOINT),
        tracks=tuple(_track(track, trace.time) for track in tracks),
    )


def _track(track: Track, time: FloatArray) -> PoseColumns:
    """Return the poses of a body at given times: the last recorded pose, or the first one before it appears."""
    record = track.record
    first = min(int(np.searchsorted(record.time, track.appears - TIME_EPSILON_S)), len(record) - 1)
    rows = np.searchsorted(record.time, time + TIME_EPSILON_S, side="right") - 1
    last = len(record) - 1
    if track.disappears is not None:
        last = max(first, int(np.searchsorted(record.time, track.disappears - TIME_EPSILON_S)) - 1)
    rows = np.clip(rows, first, last)
    position, orientation = record.position_xyz[rows], steady(record.orientation_xyzw[rows])
    since = time[-1] - record.time[-1]
    if since > TIME_EPSILON_S and last == len(record) - 1 > first:
        # The last moment lies after the last record, so extrapolate the motion.
        ahead = since / (record.time[-1] - record.time[-2])
        position[-1] += ahead * (record.position_xyz[-1] - record.position_xyz[-2])
        before, last = steady(record.orientation_xyzw[-2:])
        turned = last + ahead * (last - before)
        orientation[-1] = turned / np.linalg.norm(turned)
    return _pose_columns(position, orientation)


def _pose_columns(position_xyz: FloatArray, orientation_xyzw: FloatArray) -> PoseColumns:
    x, y, z = (Column.encoded(column, _LENGTH) for column in position_xyz.T)
    qx, qy, qz, qw = (Column.encoded(column, _TURN) for column in steady(orientation_xyzw).T)
    return (x, y, z, qx, qy, qz, qw)


_SAMPLE_PERIOD_S: Final = 1 / 15  # the resolution of signals with their own rate: about what a screen can show
_TIME_RESOLUTION_S: Final = 1e-3  # as in golden files


def stored_signals(scenario: Scenario, scene: Scene, start: Observation, film: Trace) -> tuple[SignalData, ...]:
    """Return the signals of all expectations; `start` is the settled state at t = 0."""
    frames = thinned(film)
    signals = (
        stored_signal(number, signal, frames.time, scene.physics.rate)
        for number, expected in enumerate(scenario.expect)
        for signal in expected.signals(scene, start, frames)
        if len(signal.time)
    )
    return tuple(signal for signal, _ in zip(signals, range(MAX_SIGNALS), strict=False))


def stored_events(marks: Sequence[TimeMark]) -> tuple[EventData, ...]:
    """Return the marks of the timeline as a replay holds them."""
    return tuple(
        EventData(
            time=mark.time,
            until=mark.until if mark.until is not None and mark.until > mark.time else None,
            words=mark.words[:MAX_TEXT_LENGTH],
            planned=mark.is_planned,
        )
        for mark in marks
    )


def stored_marks(scenario: Scenario, scene: Scene, start: Observation) -> tuple[MarkData, ...]:
    """Return the marks of all expectations; `start` is the settled state at t = 0."""
    marks: list[MarkData] = []
    links: Mapping[str, int] = {}
    for number, expected in enumerate(scenario.expect):
        for mark in expected.marks(scene, start):
            if mark.link and not links:
                _, links = skeleton(scene.model)
            # A place beyond the range of a replay is not visible.
            with suppress(InvalidPart):
                marks.append(_stored_mark(number, mark).model_copy(update={"link": links.get(mark.link)}))
    return tuple(marks[:MAX_MARKS])


def stored_golden(scenario: Scenario, scene: Scene) -> tuple[GoldenData, ...]:
    """Return the golden trajectories of a scenario, as far as a replay can hold them."""
    return tuple(_golden(scenario, scene))[:MAX_GOLDEN]


def _golden(scenario: Scenario, scene: Scene) -> Iterator[GoldenData]:
    if scene.workspace.updates_golden:
        return
    names = [joint.name for joint in scene.model.moving_joints]
    for number, expected in enumerate(scenario.expect):
        if not expected.assertion.has_golden:
            continue
        from sim_action.assertions.matches import Matches  # a usual run does without it
        from sim_action.state.golden_trajectory import RESOLUTION  # a usual run does without it

        assert isinstance(expected.assertion, Matches)
        golden = expected.assertion.golden_in(scene)
        if len(golden.rows) > MAX_MOMENTS:
            continue
        x, y, z, yaw, *joints = (Column.encoded(values, RESOLUTION) for values in golden.rows.T[1:])
        places = [names.index(name) for name in golden.form.joint_names]
        yield GoldenData(
            expectation=number,
            time=Column.encoded(golden.time, _TIME_RESOLUTION_S),
            base=(x, y, z, yaw),
            joints=tuple(zip(places, joints, strict=True)),
            position=expected.assertion.position,
            yaw=expected.assertion.yaw,
        )


def stored_signal(number: int, signal: Signal, frames: FloatArray, rate: float) -> SignalData:
    """Return a signal of expectation `number` at the `frames` (T,) of the replay in s, for storage; `rate` in Hz."""
    shared = np.array_equal(signal.time, frames)
    signal = signal if shared else coarse(signal, rate)
    return SignalData(
        expectation=number,
        name=signal.name[:MAX_TEXT_LENGTH],
        unit=signal.unit[:MAX_TEXT_LENGTH],
        time=None if shared else Column.encoded(signal.time, 1 / rate),
        values=Column.encoded(signal.values, fine_scale(signal.values)),
        lower=_limit(signal.lower),
        upper=_limit(signal.upper),
        start=min(signal.start, MAX_ABS_VALUE),
        end=signal.end if math.isfinite(signal.end) else None,
    )


def coarse(signal: Signal, rate: float) -> Signal:
    """Reduce a signal to first, minimum, maximum and last value of each period; times are multiples of 1 / `rate` s."""
    steps, first = np.unique(np.rint(signal.time * rate), return_index=True)
    values = signal.values[first]
    span = float(steps[-1] - steps[0]) / rate
    period = max(_SAMPLE_PERIOD_S, 4 * span / (MAX_MOMENTS - 4))
    parts = np.floor((steps - steps[0]) / rate / period)
    begins = np.flatnonzero(np.diff(parts, prepend=-1.0))
    kept = np.unique([row for begin, end in _spans(begins, len(steps)) for row in _telling(values, begin, end)])
    return replace(signal, time=steps[kept] / rate, values=values[kept])


def _spans(begins: np.ndarray[tuple[int, ...], np.dtype[np.intp]], count: int) -> Iterator[tuple[int, int]]:
    ends = [*begins.tolist()[1:], count]
    return zip(begins.tolist(), ends, strict=True)


def _telling(values: FloatArray, begin: int, end: int) -> tuple[int, int, int, int]:
    part = np.where(np.isnan(values[begin:end]), values[begin], values[begin:end])
    return begin, begin + int(part.argmin()), begin + int(part.argmax()), end - 1


def _limit(limit: float | None) -> float | None:
    return limit if limit is not None and abs(limit) <= MAX_ABS_VALUE else None


def _stored_mark(number: int, mark: Mark) -> MarkData:
    match mark:
        case Circle():
            return CircleMark(kind="circle", expectation=number, x=mark.x, y=mark.y, z=mark.z, radius=mark.radius)
        case Polygon():
            return PolygonMark(kind="polygon", expectation=number, points=mark.points)
        case Polyline():
            return PolylineMark(
                kind="polyline",
                expectation=number,
                points=mark.points,
                tolerance=mark.tolerance,
                is_aside=mark.is_aside,
            )
        case _:
            tolerance = min(math.pi, mark.tolerance)
            return ArrowMark(kind="arrow", expectation=number, x=mark.x, y=mark.y, yaw=mark.yaw, tolerance=tolerance)


# The number of values of the force over time: of all contacts together, and the limits for one.
_MAX_VALUES: Final = 12_000
_LEAST_VALUES: Final = 30
_MOST_VALUES: Final = 300
_FORCE_STEP_N: Final = 0.01
_PLACE_STEP_M: Final = 1e-3
_LEAST_WEIGHT_N: Final = 1e-9
_MAX_GAP_S: Final = 0.1  # a shorter gap does not end a contact, for example of a robot that rattles along a wall


@dataclass(slots=True)
class Touch:
    """An uninterrupted contact of a link with a body."""

    points: list[Contact]  # the contact points in the order of time
    until: float  # the time in s of the last contact
    # the time in s of each step with a contact, and the total force in N
    steps: list[tuple[float, float]] = field(default_factory=list)
    push: Vector3 = ZERO  # the sum of the forces on the link in N, as a vector in the world frame

    @property
    def first(self) -> Contact:
        """The first contact point."""
        return self.points[0]

    def add(self, contact: Contact) -> None:
        """Add a contact point of the same or a later step."""
        self.points.append(contact)
        before = self.steps.pop()[1] if self.steps and contact.time == self.until else 0.0
        self.steps.append((contact.time, before + contact.force))
        self.until = contact.time
        self.push = geometry.add(self.push, geometry.scale(contact.normal_xyz, contact.force))

    @property
    def normal(self) -> Place | None:
        """The unit vector of the mean force on the link, world frame; None if it is not known."""
        length = math.hypot(*self.push)
        if not length:
            return None
        x, y, z = numbers(geometry.scale(self.push, 1 / length))
        return (x, y, z)

    def over_time(self, rate: float, most: int) -> tuple[float, Column, tuple[Column, Column, Column]]:
        """Return a period in s, and the mean force in N and its place in m in each period since the first contact."""
        span = self.until - self.first.time + 1 / rate
        # A whole number of steps, so that each period has as many.
        period = math.ceil(max(1 / FRAME_RATE, span / most) * rate - 1e-6) / rate
        since = np.array([point.time for point in self.points]) - self.first.time
        periods = np.floor(since / period + 1e-6).astype(np.int64)
        forces = np.array([point.force for point in self.points])
        sums = np.bincount(periods, weights=forces)
        force = Column.encoded(np.minimum(sums / (period * rate), MAX_ABS_VALUE), _FORCE_STEP_N)
        # Points without a force count only if no other point has one.
        weights = np.maximum(forces, _LEAST_WEIGHT_N)
        filled = np.flatnonzero(sums_of_weights := np.bincount(periods, weights=weights))
        x, y, z = (
            Column.encoded(
                np.interp(
                    np.arange(len(sums)),
                    filled,
                    np.bincount(periods, weights=weights * axis)[filled] / sums_of_weights[filled],
                ),
                _PLACE_STEP_M,
            )
            for axis in np.array([point.position_xyz for point in self.points]).T
        )
        return period, force, (x, y, z)

    def force(self, rate: float) -> float:
        """Return the greatest mean force in N over FORCE_WINDOW_S, or over one step if that is longer."""
        window = max(FORCE_WINDOW_S, 1 / rate)
        most = present = 0.0
        oldest = 0
        for time, force in self.steps:
            present += force
            while self.steps[oldest][0] <= time - window + 0.5 / rate:
                present -= self.steps[oldest][1]
                oldest += 1
            most = max(most, present)
        return most / (window * rate)

    def impulse(self, rate: float) -> float:
        """Return the impulse of the whole contact in N s."""
        return sum(force for _, force in self.steps) / rate


def joined_touches(contacts: Iterable[Contact]) -> list[Touch]:
    """Join successive contacts of a link with a body, and return the touches in the order of their start."""
    touches: list[Touch] = []
    lasting: dict[tuple[str, str], Touch] = {}
    for contact in contacts:
        pair = contact.link, contact.body
        touch = lasting.get(pair)
        if touch is None or contact.time - touch.until > _MAX_GAP_S:
            touch = lasting[pair] = Touch([], contact.time)
            touches.append(touch)
        touch.add(contact)
    return touches


def strongest_touches(
    touches: list[Touch], links: Mapping[str, int], bodies: Mapping[str, int], rate: float
) -> tuple[tuple[ContactData, ...], int]:
    """Return the strongest touches by time, and the number of others; `links`, `bodies`: name -> index."""
    drawable = [touch for touch in touches if touch.first.link in links and touch.first.body in bodies]
    # A contact without a force comes first: neither of the two gives way.
    most = sorted(drawable, key=lambda touch: (touch.first.has_force, -touch.force(rate)))[:MAX_CONTACTS]
    values = min(_MOST_VALUES, max(_LEAST_VALUES, _MAX_VALUES // max(1, len(most))))
    kept = tuple(
        _contact_data(touch, links[touch.first.link], bodies[touch.first.body], rate, values)
        for touch in sorted(most, key=lambda touch: touch.first.time)
    )
    return kept, len(drawable) - len(kept)


def _contact_data(touch: Touch, link: int, body: int, rate: float, values: int) -> ContactData:
    x, y, z = numbers(touch.first.position_xyz)
    force, impulse = (round(min(value, MAX_ABS_VALUE), 3) for value in (touch.force(rate), touch.impulse(rate)))
    time, until = numbers((touch.first.time, touch.until))
    normal = touch.normal
    period, forces, places = (None, None, None) if normal is None else touch.over_time(rate, values)
    return ContactData(
        time=time,
        until=until,
        link=link,
        body=body,
        position=(x, y, z),
        force=force if touch.first.has_force else None,
        impulse=impulse,
        normal=normal,
        period=period,
        forces=forces,
        places=places,
    )
