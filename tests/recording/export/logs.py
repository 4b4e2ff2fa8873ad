"""MCAP logs, read back by their own libraries."""

from __future__ import annotations

import io
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sim_action.recording.export.mcap_log import McapLog
from sim_action.recording.export.recorded_run import RecordedRun


class Told(NamedTuple):
    """One message, and when it was logged in ns."""

    schema: str
    time: int
    message: Any


Log = dict[str, list[Told]]


def read(run: RecordedRun) -> Log:
    """What is recorded of a run, by topic."""
    file = io.BytesIO()
    McapLog.write(run, file)
    return read_bytes(file.getvalue())


def read_file(path: Path) -> Log:
    """What is in a file, by topic."""
    return read_bytes(path.read_bytes())


def read_bytes(data: bytes) -> Log:
    """What is in a log, by topic."""
    reader: Any = make_reader(io.BytesIO(data), validate_crcs=True, decoder_factories=[DecoderFactory()])
    log: Log = defaultdict(list)
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        log[channel.topic].append(Told(schema.name, message.log_time, decoded))
    return dict(log)
