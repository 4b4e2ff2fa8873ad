"""Patches of ROS that replace polling by the wall clock: processes of a launch act as soon as they can.

Sim time goes on while all processes sleep. A process that polls by the wall clock then acts at another sim time in
every run. Three parts of ROS are replaced for that:

- `rospy.wait_for_message` polls every 10 ms of wall time for a message. The patch wakes up with the message.
- The master notifies subscribers of a new publisher by threads that poll every 100 ms of wall time. The patch wakes
  them up with each notification.
- TCP may hold a small message back until the one before it is acknowledged, up to 40 ms of wall time (RFC 896, RFC
  1122 in 4.2.3.2), unless the subscriber asks for no delay. The patch asks for no delay everywhere.

A node that calls `time.sleep` again and again acts by the wall clock. It leaves a file with the place of the call. A
publisher leaves a file for each subscriber that it refuses, because its type of messages is another one.

rosunit writes a skipped test method as one that passed. The patch writes it as skipped. It adds the topics that the
test listens to and that had no publisher, as properties of the suite.

rospy logs what a callback of a subscriber raises, hides what a service raises in a list, and logs nothing of a timer or
another thread. The patch logs all three in the same way.

rostest ends a test after its time-limit in wall time, so a busy machine would decide. Where the launch starts a
simulation, the patch leaves the limit in a file for it: the simulation ends after as much sim time.

roslaunch starts a file without a simulation, which then waits for nothing. The patch refuses it, and leaves a file for
a simulation that is the only node: nothing can spawn a robot in it.

`sim_action.ros.node_start` installs them at the start of every process. They import nothing of this package.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import Any

SLEEPERS = "wall_clock"  # folder of files of nodes that sleep, in the folder of the logs
MISFITS = "other_types"  # folder of files of refused subscribers, in the folder of the logs
ALONE = "no_other_node"  # file of a launch that has only a simulation, in the folder of the logs
TEST_LIMIT = "test_time_limit"  # file of the limit of the running test in s of sim time, in the folder of the logs

# As long as no test takes, in s.
_NO_LIMIT_S = 1e9
_SIMULATIONS = ("gazebo", "gzserver")
# The nodes of gazebo_ros that spawn nothing.
_IDLE = (*_SIMULATIONS, "gzclient")
_NO_SIMULATION = (
    "the launch starts no simulation (gazebo_ros/gzserver), so there is no robot: launch the file that starts it "
    "together with this one, as in: sim-action roslaunch MY_ROBOT gazebo.launch MY_ROBOT navigation.launch"
)

UNPUBLISHED = "unpublished"  # name of the property of a topic without a publisher
_TRANSFORMS = ("/tf", "/tf_static")  # every listener for transforms subscribes to both, and often one is enough
_POLL_S = 0.1  # of wall time, for the check whether the node has to leave
# A node that only waits for something to come up sleeps less often, or for less wall time.
_MIN_SLEEPS, _MIN_SLEPT_S = 3, 0.2

# Topic that this process has subscribed to -> True if it had a publisher at some time.
_has_publisher = dict[str, bool]()


def wait_for_message(topic: str, topic_type: Any, timeout: Any = None) -> Any:
    """Return the next message of a topic, as rospy does. Raises ROSException, ROSInterruptException."""
    import rospy

    come = threading.Event()
    messages = []

    def hear(message: Any) -> None:
        messages.append(message)
        come.set()

    seconds = timeout.to_sec() if isinstance(timeout, rospy.Duration) else timeout
    end = None if seconds is None else time.time() + seconds
    subscriber = rospy.Subscriber(topic, topic_type, hear)
    try:
        while not messages and not rospy.is_shutdown():
            left = _POLL_S if end is None else min(_POLL_S, end - time.time())
            if left <= 0:
                raise rospy.ROSException(f"timeout exceeded while waiting for message on topic {topic}")
            come.wait(left)
    finally:
        subscriber.unregister()
    if not messages:
        raise rospy.ROSInterruptException("rospy shutdown")
    return messages[0]


def _awaiting(pool: type[Any]) -> type[Any]:
    """Return the master's thread pool with threads that wait for a task they may take."""

    class Pool(pool):  # type: ignore[misc]  # ROS has no types
        def __init__(self, threads: int) -> None:
            self._changed = threading.Condition()
            super().__init__(threads)

        def queue_task(self, *task: Any) -> Any:
            with self._changed:
                self._changed.notify_all()
                return super().queue_task(*task)

        def remove_marker(self, marker: Any) -> None:
            with self._changed:
                self._changed.notify_all()
                super().remove_marker(marker)

        def get_next_task(self) -> Any:
            with self._changed:
                while (task := super().get_next_task())[1] is None:
                    self._changed.wait()
                return task

    return Pool


def _replace_connections(connections: dict[str, Any]) -> None:
    note_misfits(connections)
    configure, listener = connections["_configure_pub_socket"], connections["TCPROSSub"]
    fields = listener.get_header_fields
    # Subscribers ask every publisher for it, in any language; our Python publishers always do it.
    listener.get_header_fields = lambda self: {**fields(self), "tcp_nodelay": "1"}
    connections["_configure_pub_socket"] = lambda socket, _: configure(socket, True)


def note_misfits(connections: dict[str, Any]) -> None:
    """Leave a file for each subscriber that this process refuses; for the namespace of rospy.impl.tcpros_pubsub."""
    handler, rospy = connections["TCPROSHandler"], connections["rospy"]
    accept = handler.topic_connection_handler

    def accept_or_note(self: Any, socket: Any, address: Any, header: dict[str, str]) -> Any:
        refusal = accept(self, socket, address, header)
        publisher = rospy.impl.registration.get_topic_manager().get_publisher_impl(header.get("topic"))
        kind = publisher and publisher.data_class
        if refusal and kind and header.get("md5sum") != kind._md5sum:  # noqa: SLF001 - genpy has no other way
            lines = *(header.get(key, "") for key in ("callerid", "topic", "type")), rospy.get_name(), kind._type  # noqa: SLF001 - likewise
            _leave_note(MISFITS, f"{os.getpid()}-{time.time_ns()}", "\n".join(lines))
        return refusal

    handler.topic_connection_handler = accept_or_note


def _replace_subscribers(topics: dict[str, Any]) -> None:
    subscriber = topics["_SubscriberImpl"]
    begin, connect = subscriber.__init__, subscriber.add_connection

    def begin_noted(self: Any, *arguments: Any, **options: Any) -> None:
        begin(self, *arguments, **options)
        _has_publisher.setdefault(self.resolved_name, self.resolved_name in _TRANSFORMS)

    def connect_noted(self: Any, connection: Any) -> Any:
        _has_publisher[self.resolved_name] = True
        return connect(self, connection)

    subscriber.__init__, subscriber.add_connection = begin_noted, connect_noted


def _replace_service_errors(services: dict[str, Any]) -> None:
    def error_handler(self: Any, error: Any, *_: Any) -> None:
        _log_callback(f"service {self.resolved_name}", error)

    services["ServiceImpl"].error_handler = error_handler


def _log_callback(name: str, error: BaseException) -> None:
    """Log an exception in the words of rospy for a subscriber."""
    import traceback  # the rest of the module runs without it

    lines = traceback.format_exception(type(error), error, error.__traceback__)
    sys.modules["rospy"].logerr("bad callback: %s\n%s", name, "".join(lines))


def _log_errors_of_threads() -> None:
    """Log what a thread of a node raises, such as the thread of a timer."""
    hook = threading.excepthook

    def log_and_print(raised: Any) -> None:
        rospy = sys.modules.get("rospy")
        if rospy is not None and rospy.core.is_initialized() and not rospy.is_shutdown() and raised.exc_value:
            _log_callback(f"thread {raised.thread.name if raised.thread else ''}", raised.exc_value)
        hook(raised)

    threading.excepthook = log_and_print


def _replace_results(runner: dict[str, Any]) -> None:
    result, write = runner["_XMLTestResult"], runner["_TestInfo"].xml
    add, stop, write_suite = result.addSkip, result.stopTest, result.xml

    def add_skip(self: Any, test: Any, reason: str) -> None:
        add(self, test, reason)
        # A class that is skipped as a whole is no test.
        if hasattr(test, "_testMethodName"):
            self.reason_to_skip = reason

    def stop_test(self: Any, test: Any) -> None:
        stop(self, test)
        self._tests[-1].reason_to_skip = vars(self).pop("reason_to_skip", None)

    def xml(self: Any) -> Any:
        case = write(self)
        if (reason := vars(self).get("reason_to_skip")) is not None:
            runner["ET"].SubElement(case, "skipped").text = str(reason)
        return case

    def suite_xml(self: Any, *arguments: Any) -> Any:
        tree = write_suite(self, *arguments)
        for topic in (topic for topic, has_publisher in sorted(_has_publisher.items()) if not has_publisher):
            runner["ET"].SubElement(tree.getroot(), "property", name=UNPUBLISHED, value=topic)
        return tree

    result.addSkip, result.stopTest, result.xml = add_skip, stop_test, suite_xml
    runner["_TestInfo"].xml = xml


def _replace_limits(runner: dict[str, Any]) -> None:
    make = runner["rostestRunner"]

    def rostest_runner(test: Any, *arguments: Any, **options: Any) -> Any:
        run, limit = make(test, *arguments, **options), test.time_limit

        def run_within_sim_time(self: Any) -> None:
            if any(node.package == "gazebo_ros" and node.type in _SIMULATIONS for node in self.config.nodes):
                _write(os.environ["ROS_LOG_DIR"], TEST_LIMIT, str(float(limit)))
                test.time_limit = _NO_LIMIT_S
            run(self)

        return run_within_sim_time

    runner["rostestRunner"] = rostest_runner


def _replace_loading(parent: dict[str, Any]) -> None:
    launch, error = parent["ROSLaunchParent"], parent["RLException"]
    load = launch._load_config  # noqa: SLF001 - the nodes are known after it, and not started yet

    def load_and_look(self: Any) -> None:
        load(self)
        nodes = [(node.package, node.type) for node in self.config.nodes]
        if self.config.tests:
            return
        if not any(package == "gazebo_ros" and kind in _SIMULATIONS for package, kind in nodes):
            raise error(_NO_SIMULATION)
        if all(package == "gazebo_ros" and kind in _IDLE for package, kind in nodes):
            _write(os.environ["ROS_LOG_DIR"], ALONE, "")

    launch._load_config = load_and_look  # noqa: SLF001 - likewise


def _note_sleeps() -> None:
    """Replace `time.sleep` by one that notes calls of the user's code after the start of the clock."""
    sleep: Any = time.sleep
    slept = dict[tuple[str, int], list[float]]()
    is_noted = False

    def sleep_and_note(seconds: Any) -> None:
        nonlocal is_noted
        sleep(seconds)
        rospy = sys.modules.get("rospy")
        if is_noted or rospy is None or not _is_clock_started():
            return
        frame = sys._getframe(1)  # noqa: SLF001 - as documented for CPython
        file, line = frame.f_code.co_filename, frame.f_lineno
        # Code of Python and of ROS may wait for something that does not depend on the clock.
        if file.startswith((_folder_of(os), _folder_of(rospy.core, 2))):
            return
        calls = slept.setdefault((file, line), [])
        calls.append(seconds)
        if len(calls) >= _MIN_SLEEPS and sum(calls) >= _MIN_SLEPT_S:
            is_noted = True
            _leave_note(SLEEPERS, str(os.getpid()), f"{rospy.get_name()}\n{file}\n{line}\n")

    time.sleep = sleep_and_note


def _is_clock_started() -> bool:
    """Return True if this process is a node that has received a sim time other than 0."""
    rostime: Any = sys.modules.get("rospy.rostime")
    if rostime is None or not rostime.is_rostime_initialized() or rostime.is_wallclock():
        return False
    return bool(rostime.get_time())


def _folder_of(module: Any, levels: int = 1) -> str:
    """Return the folder of a module, or one above it."""
    path = str(module.__file__)
    for _ in range(levels):
        path = os.path.dirname(path)  # noqa: PTH120 - to import pathlib takes 10 ms of each start
    return path


def _leave_note(folder: str, name: str, text: str) -> None:
    _write(os.path.join(os.environ["ROS_LOG_DIR"], folder), name, text)  # noqa: PTH118 - to import pathlib takes 10 ms of each start


def _write(folder: str, name: str, text: str) -> None:
    """Write a file in one step: a reader finds all of it or no file."""
    path = os.path.join(folder, name)  # noqa: PTH118 - to import pathlib takes 10 ms of each start
    os.makedirs(folder, exist_ok=True)  # noqa: PTH103 - to import pathlib takes 10 ms of each start
    with open(path + ".part", "w", encoding="utf-8") as file:  # noqa: PTH123 - to import pathlib takes 10 ms of each start
        file.write(text)
    os.replace(path + ".part", path)  # noqa: PTH105 - to import pathlib takes 10 ms of each start


# Module of ROS -> function that patches its namespace.
_REPLACED = {
    "rospy.client": lambda client: client.update(wait_for_message=wait_for_message),
    "rospy.topics": _replace_subscribers,
    "rospy.impl.tcpros_pubsub": _replace_connections,
    "rospy.impl.tcpros_service": _replace_service_errors,
    "rosunit.xmlrunner": _replace_results,
    "rosmaster.threadpool": lambda pool: pool.update(MarkedThreadPool=_awaiting(pool["MarkedThreadPool"])),
    "roslaunch.parent": _replace_loading,
    "rostest.runner": _replace_limits,
}


def install() -> dict[str, Any]:
    """Patch Python, and return module of ROS -> function that patches its namespace."""
    _note_sleeps()
    _log_errors_of_threads()
    return _REPLACED
