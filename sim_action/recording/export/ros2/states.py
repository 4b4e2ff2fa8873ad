"""/clock, /joint_states and /cmd_vel."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.cdr import CdrForm
from sim_action.recording.export.ros2.topics import Topic, nanoseconds, stamps


def states(run: RecordedRun) -> Iterator[Topic]:
    """What there is of them: a robot without joints has no states of any."""
    trace, twists = run.trace, run.twists
    count, at = len(trace), nanoseconds(trace.time)
    clock = CdrForm().gap("<i4", 2).filled(count, stamps(trace.time))
    yield Topic("/clock", "rosgraph_msgs/Clock", at, clock)
    if joints := len(trace.joint_names):
        form = CdrForm().gap("<i4", 2).string("").strings(*trace.joint_names)
        for _ in range(3):
            form.fixed("<u4", joints).gap("<f8", joints)
        columns = (trace.joint_position, trace.joint_velocity, trace.joint_effort)
        yield Topic("/joint_states", "sensor_msgs/JointState", at, form.filled(count, stamps(trace.time), *columns))
    if len(twists):
        messages = CdrForm().gap("<f8", 6).filled(len(twists), twists.values)
        yield Topic("/cmd_vel", "geometry_msgs/Twist", nanoseconds(twists.time), messages)
