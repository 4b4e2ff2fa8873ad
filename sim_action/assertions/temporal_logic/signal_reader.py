"""The reader of a formula's signals: it turns the steps of a trace into samples, block by block.

A step is left out as long as a signal is unknown: before the first reading of a sensor, or before an object appears.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, Self

import numpy as np

from sim_action.assertions.monitors import FORCE_WINDOW_S
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.contacts import MeanForce
from sim_action.assertions.sensor import picked
from sim_action.assertions.temporal_logic.formula import Signal
from sim_action.assertions.temporal_logic.formula_signals import watch_of
from sim_action.assertions.temporal_logic.robustness import Samples
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.robot.model.kinematics import LinkMotion, link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.observation import Contact, Observation
from sim_action.state.trace import Trace, yaw_angles
from sim_action.state.trace_records import BodyRecord
from sim_action.world.scene import Scene

_UNREACHED: Final = 1e9  # the value of an infinite reading, such as the range of a ray that hits nothing


@dataclass(frozen=True, slots=True)
class SignalReader:
    """Reads the signals of a formula."""

    signals: tuple[Signal, ...]
    model: RobotModel
    start_xy: tuple[float, float]
    motion: BaseMotion
    forces: Mapping[Signal, MeanForce] = field(default_factory=dict)
    readings: Mapping[Signal, float] = field(default_factory=dict)

    @classmethod
    def of(cls, signals: tuple[Signal, ...], scene: Scene, start: Observation) -> Self:
        """Return the reader before the first step; `start` is the state at t = 0."""
        x, y, _ = start.pose.position_xyz
        forces = {
            signal: MeanForce.of(scene.physics.rate, FORCE_WINDOW_S, _meant(signal, start.contacts))
            for signal in signals
            if signal.name == "force" and signal.source == "pair"
        }
        return cls(signals, scene.model, (x, y), BaseMotion.of(scene, start), forces)

    def begun(self, trace: Trace) -> Self:
        """Return the reader after steps that are not judged: forces are means, and readings last."""
        if not (bool(self.forces) or any(signal.source == "sensor" for signal in self.signals)):
            return self
        forces = {
            signal: mean.observe(trace, _meant(signal, trace.contacts))[0] for signal, mean in self.forces.items()
        }
        return replace(self, forces=forces, readings={**self.readings, **dict(self._last_readings(trace))})

    def after(self, trace: Trace) -> Self:
        """Return the reader after the steps of a trace."""
        return replace(self.begun(trace), motion=self.motion.after(trace))

    def read(self, trace: Trace) -> Samples:
        """Return the samples at the steps of a trace at which all signals are known."""
        rows = np.column_stack([trace.time, *(self._column(trace, signal) for signal in self.signals)])
        if all(signal.source == "robot" for signal in self.signals):
            return Samples(self.signals, rows)
        known = ~np.isnan(rows).any(axis=1)
        return Samples(self.signals, np.clip(rows if known.all() else rows[known], -_UNREACHED, _UNREACHED))

    def _last_readings(self, trace: Trace) -> Iterator[tuple[Signal, float]]:
        for signal in self.signals:
            record = trace.sensors.get(signal.names[0]) if signal.source == "sensor" else None
            if record is not None and len(record):
                yield signal, float(picked(record.columns[signal.name][-1:], _which(signal))[0])

    def _column(self, trace: Trace, signal: Signal) -> FloatArray:
        match signal.source:
            case "frame":
                return self._frame_column(trace, signal)
            case "sensor":
                return self._sensor_column(trace, signal)
            case "pair":
                return self._pair_column(trace, signal)
            case _:
                return self._robot_column(trace, signal)

    def _robot_column(self, trace: Trace, signal: Signal) -> FloatArray:
        if signal.joint:
            columns: FloatArray = getattr(trace, f"joint_{signal.name}")
            return columns[:, trace.joint_names.index(signal.joint)]
        match signal.name:
            case "x" | "y" | "z":
                return trace.base_position_xyz[:, "xyz".index(signal.name)]
            case "travel":
                return trace.planar_distance_to(*self.start_xy)
            case "speed" | "turn_rate":
                return self.motion.speed(trace) if signal.name == "speed" else self.motion.turn_rate(trace)
            case "time":
                return trace.time
            case _:
                return _angle(trace.base_orientation_xyzw, signal.name)

    def _frame_column(self, trace: Trace, signal: Signal) -> FloatArray:
        frame = self._frame(trace, signal.names[0])
        match signal.name:
            case "x" | "y" | "z":
                return frame.position_xyz[:, "xyz".index(signal.name)]
            case "speed" | "turn_rate":
                assert isinstance(frame, LinkMotion), "objects have no twists"
                return _norm(frame.linear_xyz if signal.name == "speed" else frame.angular_xyz)
            case _:
                return _angle(frame.orientation_xyzw, signal.name)

    def _frame(self, trace: Trace, name: str) -> LinkMotion | BodyRecord:
        return link_motion(self.model, trace, name) if name in self.model.links_by_name else trace.objects[name]

    def _pair_column(self, trace: Trace, signal: Signal) -> FloatArray:
        if signal.name == "distance":
            first, second = (self._frame(trace, name).position_xyz for name in signal.names)
            return _norm(first - second)
        if signal.name == "force":
            _, (time, mean) = self.forces[signal].observe(trace, _meant(signal, trace.contacts))
            return _held(time, mean, trace.time + TIME_EPSILON_S, 0.0)
        record = trace.clearances.get(watch_of(signal))
        if record is None or not len(record):
            return np.full(len(trace), np.nan)
        at = np.searchsorted(record.time, trace.time - TIME_EPSILON_S).clip(max=len(record) - 1)
        is_there = np.abs(record.time[at] - trace.time) <= TIME_EPSILON_S
        return np.where(is_there, record.distance[at], np.nan)

    def _sensor_column(self, trace: Trace, signal: Signal) -> FloatArray:
        """Return (T,) the last reading before each step; that of t = 0 also counts at t = 0."""
        before = self.readings.get(signal, np.nan)
        record = trace.sensors.get(signal.names[0])
        if record is None or not len(record):
            return np.full(len(trace), before)
        time = np.where(record.time > TIME_EPSILON_S, record.time, -np.inf)
        return _held(time, picked(record.columns[signal.name], _which(signal)), trace.time - TIME_EPSILON_S, before)


def _held(time: FloatArray, values: FloatArray, wanted: FloatArray, before: float) -> FloatArray:
    at = np.searchsorted(time, wanted, side="right")
    return np.concatenate(([before], values))[at]


def _meant(signal: Signal, contacts: Iterable[Contact]) -> list[Contact]:
    *link, body = signal.names
    return [contact for contact in contacts if contact.body == body and (not link or contact.link == link[0])]


def _which(signal: Signal) -> str | None:
    return signal.names[1] if len(signal.names) > 1 else None


def _angle(orientations: FloatArray, name: str) -> FloatArray:
    """Return (T,) rad: an angle of URDF's convention (roll about x, then pitch about y, then yaw about z), or tilt."""
    if name == "yaw":
        return yaw_angles(orientations)
    x, y, z, w = orientations.T
    match name:
        case "roll":
            found = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        case "pitch":
            found = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
        case _:
            found = np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0))
    return np.asarray(found, dtype=np.float64)


def _norm(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), dtype=np.float64)
