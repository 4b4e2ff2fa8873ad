"""Storage of traces: a .npz file with one array for each column; sensors, clearances and bodies are numbered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final, TypeVar

from sim_action.core.files import open_regular, whole_file
from sim_action.core.lazy_numpy import np
from sim_action.core.records import replace
from sim_action.state.observation import Contact, SelfContact
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import COLUMNS, Trace
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
_MAX_BYTES: Final = 2_000_000_000
_Record = TypeVar("_Record", BodyRecord, ContactRecord, ClearanceRecord)


class TraceError(ValueError):
    """A file that is not a trace."""


def save_trace(trace: Trace, path: Path, marks: Sequence[TimeMark] = ()) -> None:
    """Write a trace as .npz, with the marks of the timeline, if there are some, for readers of arrays."""
    columns = {name: getattr(trace, name) for name in COLUMNS}
    told = {
        **_contact_arrays(trace),
        **_self_contact_arrays(trace),
        **_sensor_arrays(trace.sensors),
        **_clearance_arrays(trace.clearances),
        **_arrays("body", trace.bodies),
        **_arrays("object", trace.objects),
        **_arrays("touching", trace.link_contacts),
    }
    if marks:
        told["mark_time"] = np.array([mark.time for mark in marks], dtype=np.float64)
        told["mark_words"] = np.array([mark.words for mark in marks], dtype=np.str_)
    arrays: dict[str, Any] = {"joint_names": np.array(trace.joint_names, dtype=np.str_), **columns, **told}
    save_arrays(arrays, path)


def load_trace(path: Path) -> Trace:
    """Read a file that `save_trace` wrote, without unpickling. Raise TraceError."""
    try:
        with open_regular(path, follow_link=True) as file, np.load(file, allow_pickle=False) as stored:
            refuse_too_large(stored)
            names = tuple(stored["joint_names"].tolist())
            columns = {name: stored[name] for name in COLUMNS}
            fields = (field for field in Contact._fields if field not in _ADDED or f"contact_{field}" in stored)
            contacts = zip(*(stored[f"contact_{field}"].tolist() for field in fields), strict=True)
            trace = Trace.of_columns(names, tuple(_contact(*row) for row in contacts), **columns)
            sensors, clearances = _sensor_records(stored), _clearance_records(stored)
            bodies, objects = (_records(kind, BodyRecord, stored) for kind in ("body", "object"))
            _refuse_other_times(objects, trace)
            touches = _records("touching", ContactRecord, stored)
            told = replace(trace, sensors=sensors, clearances=clearances, bodies=bodies, objects=objects)
            return replace(told, self_contacts=_self_contacts(stored), link_contacts=touches)
    except Exception as error:  # noqa: BLE001 - numpy and zipfile raise many types for damaged files
        raise TraceError(f"{path}: not a trace: {error}") from None


def refuse_too_large(stored: Any) -> None:
    """Raise ValueError for a small file that unpacks to a huge one."""
    size = sum(member.file_size for member in stored.zip.infolist())
    if size > _MAX_BYTES:
        raise ValueError(f"it holds {size // 1_000_000} MB; a trace holds at most {_MAX_BYTES // 1_000_000} MB")


def _contact_arrays(trace: Trace) -> dict[str, Any]:
    contacts = trace.contacts
    return {
        "contact_time": np.array([c.time for c in contacts], dtype=np.float64),
        "contact_link": np.array([c.link for c in contacts], dtype=np.str_),
        "contact_body": np.array([c.body for c in contacts], dtype=np.str_),
        "contact_position_xyz": np.array([c.position_xyz for c in contacts], dtype=np.float64).reshape(-1, 3),
        "contact_force": np.array([c.force for c in contacts], dtype=np.float64),
        "contact_has_force": np.array([c.has_force for c in contacts], dtype=np.bool_),
        "contact_depth": np.array([c.depth for c in contacts], dtype=np.float64),
    }


def _contact(time: float, link: str, body: str, position_xyz: list[float], *strength: Any) -> Contact:
    x, y, z = position_xyz
    return Contact(time, link, body, (x, y, z), *strength)


def _self_contact_arrays(trace: Trace) -> dict[str, Any]:
    """Return the arrays of the contacts between links; nothing without any."""
    contacts = trace.self_contacts
    if not contacts:
        return {}
    arrays = {field: np.array([getattr(each, field) for each in contacts]) for field in SelfContact._fields}
    return {f"self_contact_{field}": array for field, array in arrays.items()}


def _self_contacts(stored: Mapping[str, Any]) -> tuple[SelfContact, ...]:
    """Return the contacts from the arrays that `_self_contact_arrays` made."""
    if "self_contact_time" not in stored:
        return ()
    columns = (stored[f"self_contact_{field}"].tolist() for field in SelfContact._fields)
    return tuple(
        SelfContact(time, link, other, (x, y, z), *strength)
        for time, link, other, (x, y, z), *strength in zip(*columns, strict=True)
    )


def _sensor_arrays(sensors: Mapping[str, SensorRecord]) -> dict[str, Any]:
    """Return the arrays of all sensors; they are numbered, because names of sensors are not valid in files."""
    if not sensors:
        return {}
    arrays: dict[str, Any] = {
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


def _clearance_arrays(clearances: Mapping[ClearanceWatch, ClearanceRecord]) -> dict[str, Any]:
    """Return the arrays of all clearances, numbered."""
    arrays: dict[str, Any] = {}
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


# The array with the names of what the records of a kind are about.
_NAMES: Final = {"body": "body_names", "object": "object_names", "touching": "touching_links"}


def _arrays(kind: str, records: Mapping[str, BodyRecord] | Mapping[str, ContactRecord]) -> dict[str, Any]:
    """Return the arrays of all records of a kind, numbered."""
    arrays: dict[str, Any] = {_NAMES[kind]: np.array(list(records), dtype=np.str_)} if records else {}
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
