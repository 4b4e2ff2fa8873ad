"""A real master and real nodes: connections, processes, and nodes that left without unregistering."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from sim_action.ros.processes import WatchedProcesses, children
from sim_action.ros.ros1 import lockstep
from sim_action.ros.ros1.launch.ros_patches import MISFITS
from sim_action.ros.ros1.master import Graph, Master
from tests.patience import wait_until
from tests.ros.ros1.launches import needs_ros, ros

pytestmark = [needs_ros, pytest.mark.process]

NODE = """\
import sys, rospy
from std_msgs.msg import String
rospy.init_node(sys.argv[1])
for topic in sys.argv[2].split():
    rospy.Publisher(topic, String, queue_size=1)
for topic in sys.argv[3].split():
    rospy.Subscriber(topic, String, lambda _: None)
print('up', flush=True)
rospy.spin()
"""


@dataclass(frozen=True)
class Ros:
    uri: str
    pid: int

    @contextmanager
    def node(self, name: str, publishes: str = "", hears: str = "") -> Iterator[subprocess.Popen[str]]:
        command = [str(ros().python), "-c", NODE, name, publishes, hears]
        variables = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost"}
        with subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, text=True) as started:
            try:
                assert started.stdout is not None
                assert started.stdout.readline() == "up\n"
                yield started
            finally:
                started.kill()


def free_port() -> int:
    """A port that no client of another test is given: those begin at 32768 (ip_local_port_range)."""
    port = 10_000 + os.getpid() % 20_000
    while True:
        try:
            socket.create_server(("localhost", port)).close()
        except OSError:
            port += 1
        else:
            return port


@pytest.fixture
def master() -> Iterator[Ros]:
    port = free_port()
    command = [str(ros().program("rosmaster")), "--core", "-p", str(port)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as started:
        made = Ros(f"http://localhost:{port}/", started.pid)
        try:
            yield made
        finally:
            started.kill()


@pytest.fixture
def asking(master: Ros) -> Iterator[Master]:
    with closing(Master(master.uri, "/looker")) as made:
        wait_until(lambda: answers(made))
        yield made


def answers(asking: Master) -> bool:
    try:
        asking.graph()
    except OSError:
        return False
    return True


def wait_until_connected(asking: Master) -> None:
    wait_until(lambda: asking.first_unconnected(asking.graph()) is None)


def test_nodes_their_processes_and_their_connections(
    master: Ros, asking: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    with master.node("one", publishes="/a /b") as one, master.node("listener", hears="/a /nobody") as listener:
        graph = asking.graph()
        assert graph.master == master.pid
        assert graph.pids == {"/one": one.pid, "/listener": listener.pid}
        assert graph.publishers["/a"] == graph.publishers["/b"] == {"/one"}
        assert graph.subscribers["/a"] == {"/listener"}
        wait_until_connected(asking)
        with master.node("two", publishes="/a"):
            assert asking.graph().publishers["/a"] == {"/one", "/two"}
            wait_until_connected(asking)
            # Without a word to the master: it is neither there nor waited for.
            one.kill()
            one.wait()
            graph = asking.graph()
            assert graph.publishers["/a"] == {"/two"}
            assert graph.pids.keys() == {"/two", "/listener"}
            assert asking.first_unconnected(graph) is None
        with master.node("one", publishes="/a") as again:
            assert asking.graph().pids["/one"] == again.pid
            wait_until_connected(asking)
            graph = asking.graph()
            listener.send_signal(signal.SIGSTOP)
            monkeypatch.setattr("sim_action.ros.ros1.master._TIMEOUT_S", 1.0)
            assert asking.first_unconnected(graph) == ("/listener", "/a")


def test_a_master_that_is_busy_is_waited_for(master: Ros, asking: Master) -> None:
    os.kill(master.pid, signal.SIGSTOP)
    going_on = threading.Timer(1.5, os.kill, (master.pid, signal.SIGCONT))
    going_on.start()
    assert asking.graph().master == master.pid
    going_on.join()


def test_a_node_that_leaves_while_another_one_connects_is_awaited(
    asking: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    connections = iter([{"leaver"}, {"newcomer"}])
    awaited: list[bool] = []
    clock = lockstep.Lockstep(asking, os.getpid(), lambda: False, lambda: frozenset(next(connections)))
    monkeypatch.setattr(clock, "await_leavers", lambda: awaited.append(True))
    clock.deliver(0.0, ())
    assert not awaited
    clock.deliver(0.01, ())
    assert awaited


def test_a_node_that_wakes_up_between_two_ticks_polls_and_the_log_of_ros_does_not(
    asking: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = lockstep_of(asking)
    clock.deliver(0.0, ())
    monkeypatch.setattr(clock, "_pids", {"/rosout": 1, "/polling": 2})
    monkeypatch.setattr(WatchedProcesses, "awakenings", lambda _: {1: 1_000_000, 2: 1_000_000})
    clock.deliver(0.01, ())
    (reason,) = clock.not_reproducible
    assert "the node 'polling' does not wait for sim time: it wakes up" in reason


@contextmanager
def posing(pid: int) -> Iterator[str]:
    """The address of a node that answers as a process, and is connected to nothing."""
    server = SimpleXMLRPCServer(("localhost", 0), logRequests=False)
    server.register_function(lambda _: (1, "", pid), "getPid")
    server.register_function(lambda _: (1, "", []), "getBusInfo")
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://localhost:{server.server_address[1]}/"
    server.shutdown()
    server.server_close()


def lockstep_of(asking: Master) -> lockstep.Lockstep:
    return lockstep.Lockstep(asking, os.getpid(), lambda: False, frozenset, newcomers_within=0.2)


def test_a_clock_that_starts_although_a_node_is_not_connected_is_not_reproducible(
    master: Ros, asking: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lockstep, "MAX_SETTLE_S", 0.2)
    with ServerProxy(master.uri) as register, master.node("listener", hears="/a"), posing(os.getpid()) as uri:
        register.registerPublisher("/deaf", "/a", "std_msgs/String", uri)
        clock = lockstep_of(asking)
        clock.begin(frozenset, lambda: False)
    reason = "the node 'listener' had no connection to all publishers of /a after 0.2 s of wall time"
    assert reason in clock.not_reproducible


def test_the_process_that_roslaunch_knows_is_awaited_if_a_shell_has_started_the_node(
    master: Ros, asking: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lockstep, "_CALM_S", 0.0)
    words = ["sh", "-c", "sleep 100 & echo $!; wait; sleep 0.5"]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as shell:
        assert shell.stdout is not None
        node = int(shell.stdout.readline())
        with ServerProxy(master.uri) as register, posing(node) as uri:
            register.registerPublisher("/child", "/a", "std_msgs/String", uri)
            clock = lockstep_of(asking)
            clock.begin(frozenset, lambda: False)
            register.unregisterPublisher("/child", "/a", uri)
            os.kill(node, signal.SIGTERM)
            threading.Thread(target=shell.wait).start()
            clock.await_leavers()
            assert shell.pid not in children(os.getpid())


def sockets() -> int:
    links = (str(entry.readlink()) for entry in Path("/proc/self/fd").iterdir() if entry.is_symlink())
    return sum(link.startswith("socket:") for link in links)


def test_a_connection_ends_when_it_is_closed_and_a_master_that_has_gone_is_an_error(
    master: Ros, asking: Master
) -> None:
    other, before = Master(master.uri, "/other"), sockets()
    other.graph()
    assert sockets() == before + 1
    other.close()
    assert sockets() == before
    os.kill(master.pid, signal.SIGKILL)
    while Path("/proc", str(master.pid), "fd").exists() and answers(asking):
        time.sleep(0.01)
    with pytest.raises(OSError, match="does not answer"):
        asking.graph()


def test_a_note_of_a_refused_subscriber_that_cannot_be_read_is_no_refusal(tmp_path: Path) -> None:
    (tmp_path / MISFITS).mkdir()
    (tmp_path / MISFITS / "12-34").touch()
    (tmp_path / MISFITS / "7-9").write_text("/ear\n/topic\nstd_msgs/String\n/mouth\nstd_msgs/Int32")
    graph = Graph({"/topic": frozenset({"/mouth"})}, {"/topic": frozenset({"/ear"})}, {"/mouth": 7}, 1)
    asking = Master("http://localhost:1/", "/it", tmp_path)
    asking.graph = lambda: graph  # type: ignore[method-assign]  # no master runs
    assert asking.misfit_notes() == [
        "the node 'ear' subscribes to /topic as std_msgs/String, but the node 'mouth' publishes std_msgs/Int32"
    ]
