"""MCAP logs of ROS 2 messages: `--record mcap`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, BinaryIO, ClassVar

import numpy as np

from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.markers import contacts, world_markers
from sim_action.recording.export.ros2.messages import definition, full_name
from sim_action.recording.export.ros2.robot_description import robot_description
from sim_action.recording.export.ros2.state_topics import sensing, states
from sim_action.recording.export.ros2.topics import Frames, Topic
from sim_action.recording.export.ros2.transforms import odometry, transforms

if TYPE_CHECKING:
    from mcap.writer import Writer


class McapLog:
    """A log of ROS 2 messages for Foxglove, Lichtblick and `ros2 bag`: frames, joints, odometry, commands, contacts.

    Times are sim time. The frame `map` is the world. `odom` coincides with it, unless the trace contains wheel
    odometry, which drifts relative to `map`.
    """

    extra: ClassVar[str] = "mcap"
    packages: ClassVar[tuple[str, ...]] = ("mcap.writer",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        from mcap.writer import Writer

        writer: Any = Writer(file)  # not all of it has types
        writer.start(profile="ros2")
        _write_topics(writer, list(topics(run)))
        writer.finish()


def topics(run: RecordedRun) -> Iterator[Topic]:
    """Yield all topics of a run; those with a single message come first."""
    frames = Frames.of(run)
    yield from robot_description(run)
    yield from transforms(run, frames)
    yield from world_markers(run, frames)
    yield from states(run)
    yield from odometry(run, frames)
    yield from sensing(run, frames)
    yield from contacts(run, frames)


def _write_topics(writer: Writer, written: list[Topic]) -> None:
    """Write all messages in the order of their times."""
    schemas: dict[str, int] = {}
    channels = []
    for topic in written:
        if topic.type not in schemas:
            text = definition(topic.type).encode()
            schemas[topic.type] = writer.register_schema(full_name(topic.type), "ros2msg", text)
        channels.append(writer.register_channel(topic.name, "cdr", schemas[topic.type], topic.about))
    times = np.concatenate([topic.time for topic in written])
    messages = [message for topic in written for message in topic.messages]
    of = [channel for channel, topic in zip(channels, written, strict=True) for _ in topic.messages]
    for index in np.argsort(times, kind="stable").tolist():
        time = int(times[index])
        writer.add_message(of[index], time, messages[index], time)
