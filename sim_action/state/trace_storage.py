"""Storage of traces and of motions: .npz files.

A trace has one array for each column; sensors, clearances and bodies are numbered. A record of the motion at every
physics step is for the comparison of two runs only: it does not depend on the stored trace, and no results keep it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final, TypeVar

from sim_action.core.files import open_regular, whole_file
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.state.observation import Contact, SelfContact
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import COLUMNS, Trace, yaw_angles
from sim_action.state.trace_records import (
    ALWAYS,
    BodyRecord,
    ClearanceRecord,
    ClearanceWatch,
    ContactRecord,
    SensorRecord,
)

# Fields that older traces lack; the last one is in none.
_ADDED: Final = ("has_force", "depth", "normal_xyz")
_TYPES: Final = {"link": "str", "body": "str", "other": "str", "has_force": "bool"}  # the others are 64-bit floats
_MAX_BYTES: Final = 2_000_000_000
_Arrays = dict[str, Any]
_Touch = TypeVar("_Touch", Contact, SelfContact)
_Record = TypeVar("_Record", BodyRecord, ContactRecord, ClearanceRecord)


class TraceError(ValueError):
    """A file that is not a trace."""


def save_trace(trace: Trace, path: Path, marks: Sequence[TimeMark] = ()) -> None:
    """Write a trace as .npz, with the marks of the timeline, if there are some, for readers of arrays."""
    columns = {name: getattr(trace, name) for name in COLUMNS}
    records = {
        **_touch_arrays("contact", trace.contacts, Contact._fields),
        **(_touch_arrays("self_contact", own, SelfContact._fields) if (own := trace.self_contacts) else {}),
        **_sensor_arrays(trace.sensors),
        **_clearance_arrays(trace.clearances),
        **_arrays("body", trace.bodies),
        **_arrays("object", trace.objects),
        **_arrays("touching", trace.link_contacts),
    }
    if marks:
        records["mark_time"] = np.array([mark.time for mark in marks], dtype=np.float64)
        records["mark_words"] = np.array([mark.words for mark in marks], dtype=np.str_)
    arrays: _Arrays = {"joint_names": np.array(trace.joint_names, dtype=np.str_), **columns, **records}
    save_arrays(arrays, path)


def load_trace(path: Path) -> Trace:
    """Read a file that `save_trace` wrote, without unpickling. Raise TraceError."""
    try:
        with open_regular(path, follow_link=True) as file, np.load(file, allow_pickle=False) as stored:
            refuse_too_large(stored)
            names = tuple(stored["joint_names"].tolist())
            columns = {name: stored[name] for name in COLUMNS}
            trace = Trace.of_columns(names, _touches("contact", Contact, stored), **columns)
            sensors = _sensor_records(stored)
            clearances = _clearance_records(stored)
            bodies, objects = (_records(kind, BodyRecord, stored) for kind in ("body", "object"))
            _refuse_other_times(objects, trace)
            touches = _records("touching", ContactRecord, stored)
            with_records = replace(trace, sensors=sensors, clearances=clearances, bodies=bodies, objects=objects)
            own = _touches("self_contact", SelfContact, stored) if "self_contact_time" in stored else ()
            return replace(with_records, self_contacts=own, link_contacts=touches)
    except Exception as error:  # noqa: BLE001 - numpy and zipfile raise many types for damaged files
        raise TraceError(f"{path}: not a trace: {error}") from None


def refuse_too_large(stored: Any) -> None:
    """Raise ValueError for a small file that unpacks to a huge one."""
    size = sum(member.file_size for member in stored.zip.infolist())
    if size > _MAX_BYTES:
        raise ValueError(f"it holds {size // 1_000_000} MB; a trace holds at most {_MAX_BYTES // 1_000_000} MB")


def _touch_arrays(kind: str, contacts: Sequence[Contact] | Sequence[SelfContact], fields: Iterable[str]) -> _Arrays:
    """Return an array for each field of contacts that files have."""
    arrays: _Arrays = {}
    for name in fields:
        if name != "normal_xyz":
            column = np.array([getattr(contact, name) for contact in contacts], dtype=_TYPES.get(name, "float64"))
            arrays[f"{kind}_{name}"] = column.reshape(-1, 3) if name == "position_xyz" else column
    return arrays


def _touches(kind: str, made: type[_Touch], stored: Mapping[str, Any]) -> tuple[_Touch, ...]:
    """Return the contacts from the arrays that `_touch_arrays` made."""
    fields = (field for field in made._fields if field not in _ADDED or f"{kind}_{field}" in stored)
    columns = {field: stored[f"{kind}_{field}"].tolist() for field in fields}
    columns["position_xyz"] = [(x, y, z) for x, y, z in columns["position_xyz"]]
    return tuple(made(*row) for row in zip(*columns.values(), strict=True))


def _sensor_arrays(sensors: Mapping[str, SensorRecord]) -> _Arrays:
    """Return the arrays of all sensors; they are numbered, because names of sensors are not valid in files."""
    if not sensors:
        return {}
    arrays: _Arrays = {
        "sensor_names": np.array(list(sensors), dtype=np.str_),
        "sensor_kinds": np.array([record.kind for record in sensors.values()], dtype=np.str_),
    }
    for index, record in enumerate(sensors.values()):
        columns = {"time": record.time, **record.columns}
        arrays |= {f"sensor_{index}_{name}": column for name, column in columns.items()}
    return arrays


def _sensor_records(stored: Mapping[str, Any]) -> dict[str, SensorRecord]:
    """Return the records from the arrays that `_sensor_arrays` made."""
    if "sensor_names" not in stored:
        return {}
    records = {}
    for index, (name, kind) in enumerate(zip(stored["sensor_names"], stored["sensor_kinds"], strict=True)):
        start = f"sensor_{index}_"
        columns = {array.removeprefix(start): stored[array] for array in stored if array.startswith(start)}
        records[str(name)] = SensorRecord(str(kind), columns.pop("time"), columns)
    return records


def _clearance_arrays(clearances: Mapping[ClearanceWatch, ClearanceRecord]) -> _Arrays:
    """Return the arrays of all clearances, numbered."""
    arrays: _Arrays = {}
    for index, (watch, record) in enumerate(clearances.items()):
        start = f"clearance_{index}_"
        arrays |= {f"{start}{name}": getattr(record, name) for name in record.widths}
        arrays[f"{start}pairs"] = np.array(record.pairs, dtype=np.str_).reshape(-1, 2)
        if record.presence != (ALWAYS,):
            arrays[f"{start}presence"] = np.array(record.presence, dtype=np.float64)
        arrays[f"{start}range"] = np.array((watch.within, watch.always), dtype=np.float64)
        named = {"links": watch.links, "bodies": watch.bodies}
        arrays |= {f"{start}{kind}": np.array(names, np.str_) for kind, names in named.items() if names is not None}
    return arrays


def _clearance_records(stored: Mapping[str, Any]) -> dict[ClearanceWatch, ClearanceRecord]:
    """Return the records from the arrays that `_clearance_arrays` made."""
    records = {}
    index = 0
    while (start := f"clearance_{index}_") + "range" in stored:
        links, bodies = (
            tuple(stored[f"{start}{kind}"].tolist()) if f"{start}{kind}" in stored else None
            for kind in ("links", "bodies")
        )
        within, always = stored[f"{start}range"].tolist()
        pairs = tuple((link, body) for link, body in stored[f"{start}pairs"].tolist())
        spans = stored[f"{start}presence"].tolist() if f"{start}presence" in stored else [ALWAYS]
        presence = tuple((first, gone) for first, gone in spans)
        time, distance, pair = (stored[f"{start}{name}"] for name in ClearanceRecord.widths)
        record = _whole(ClearanceRecord(pairs, time, distance, pair, presence), start)
        records[ClearanceWatch(links, bodies, within, bool(always))] = record
        index += 1
    return records


def _refuse_other_times(objects: Mapping[str, BodyRecord], trace: Trace) -> None:
    for name, record in objects.items():
        if not np.array_equal(record.time, trace.time):
            raise ValueError(f"the object '{name}' has other times than the trace")


# Kind of record -> the array with the names of its bodies, objects or links.
_NAMES: Final = {"body": "body_names", "object": "object_names", "touching": "touching_links"}


def _arrays(kind: str, records: Mapping[str, BodyRecord] | Mapping[str, ContactRecord]) -> _Arrays:
    """Return the arrays of all records of a kind, numbered."""
    arrays: _Arrays = {_NAMES[kind]: np.array(list(records), dtype=np.str_)} if records else {}
    for index, record in enumerate(records.values()):
        start = f"{kind}_{index}_"
        if record.names:
            arrays[f"{start}{record.names}"] = np.array(getattr(record, record.names), dtype=np.str_)
        arrays |= {f"{start}{name}": getattr(record, name) for name in record.widths}
    return arrays


def _records(kind: str, made: type[_Record], stored: Mapping[str, Any]) -> dict[str, _Record]:
    """Return the records from the arrays that `_arrays` made."""
    records = {}
    for index, name in enumerate(stored[_NAMES[kind]].tolist() if _NAMES[kind] in stored else ()):
        start = f"{kind}_{index}_"
        names: dict[str, Any] = {made.names: tuple(stored[f"{start}{made.names}"].tolist())} if made.names else {}
        records[str(name)] = _whole(
            made(**names, **{column: stored[f"{start}{column}"] for column in made.widths}), start
        )
    return records


def _whole(record: _Record, start: str) -> _Record:
    if not record.is_whole:
        raise ValueError(f"the columns of '{start}' have different lengths")
    return record


def save_arrays(arrays: Mapping[str, Any], path: Path) -> None:
    """Write a .npz file, completely or not at all. Raise OSError."""
    # For each array a zip file goes back in what it has written; in memory that calls no system.
    content = BytesIO()
    np.savez(content, **arrays)
    with whole_file(path) as file:
        file.write(content.getbuffer())


_POSE: Final = 7


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """The motion at T moments: t = 0 and each physics step after it."""

    time: FloatArray
    # (T, 7) the pose of the base link in the world frame: position in m, and unit quaternion x, y, z, w
    base: FloatArray
    # joint name -> its positions (T,) in rad, or m if prismatic
    joints: Mapping[str, FloatArray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)  # joint name -> "rad" or "m"
    # compared links, compared bodies: name -> poses (T, 7) in the world frame
    links: Mapping[str, FloatArray] = field(default_factory=dict)
    bodies: Mapping[str, FloatArray] = field(default_factory=dict)
    bolted: bool = False  # True if the base is fixed

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, selection: NDArray[np.intp]) -> MotionRecord:
        """Return some of the moments."""
        return MotionRecord(
            self.time[selection],
            self.base[selection],
            {name: column[selection] for name, column in self.joints.items()},
            self.units,
            {name: poses[selection] for name, poses in self.links.items()},
            {name: poses[selection] for name, poses in self.bodies.items()},
            self.bolted,
        )

    @property
    def yaw(self) -> FloatArray:
        """The heading of the base about the world's z axis, (T,) rad in (-pi, pi]."""
        return yaw_angles(self.base[:, 3:])

    @property
    def is_finite(self) -> bool:
        """True if all numbers are finite."""
        columns = (self.time, self.base, *self.joints.values(), *self.links.values(), *self.bodies.values())
        return all(bool(np.isfinite(column).all()) for column in columns)

    def save(self, path: Path) -> None:
        """Write the record as .npz. Raise OSError."""
        arrays: dict[str, Any] = {
            "time": self.time,
            "base": self.base,
            "bolted": np.array(self.bolted),
            **_named("joints", self.joints),
            "units": np.array([self.units[name] for name in self.joints], dtype=np.str_),
            **_named("links", self.links),
            **_named("bodies", self.bodies),
        }
        save_arrays(arrays, path)

    @classmethod
    def load(cls, path: Path) -> MotionRecord:
        """Read a file that `save` wrote, without unpickling. Raise TraceError."""
        try:
            with open_regular(path, follow_link=False) as file, np.load(file, allow_pickle=False) as stored:
                refuse_too_large(stored)
                time = _column(stored["time"], stored["time"].size)
                joints = _columns(stored, "joints", (len(time),))
                links, bodies = (_columns(stored, group, (len(time), _POSE)) for group in ("links", "bodies"))
                base = _column(stored["base"], len(time), _POSE)
                bolted = bool(stored["bolted"])
                units = dict(zip(joints, stored["units"].tolist(), strict=True))
                return cls(time, base, joints, units, links, bodies, bolted)
        except Exception as error:  # noqa: BLE001 - numpy and zipfile raise many types for damaged files
            raise TraceError(f"{path}: not a record of a motion: {error}") from None


def _named(group: str, columns: Mapping[str, FloatArray]) -> dict[str, Any]:
    numbered = {f"{group}_{number}": column for number, column in enumerate(columns.values())}
    return {f"{group}_names": np.array(list(columns), dtype=np.str_), **numbered}


def _columns(stored: Mapping[str, Any], group: str, shape: tuple[int, ...]) -> dict[str, FloatArray]:
    names = stored[f"{group}_names"].tolist()
    return {str(name): _column(stored[f"{group}_{number}"], *shape) for number, name in enumerate(names)}


def _column(values: Any, *shape: int) -> FloatArray:
    """Return an array after its shape and type are checked. Raise ValueError."""
    if values.shape != shape or values.dtype != np.float64:
        raise ValueError(f"an array has the shape {values.shape} of {values.dtype}")
    column: FloatArray = values
    return column
