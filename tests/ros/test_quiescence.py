"""Quiescence of real processes: threads that run, sleep, wake up, start and end."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

from sim_action.ros.processes import WatchedProcesses
from tests.patience import PATIENCE

pytestmark = [pytest.mark.skipif(sys.platform != "linux", reason="it reads Linux's /proc"), pytest.mark.process]
LONG = float(PATIENCE)
SHORT = 0.2

# It says a line when it is about to do what it is there for.
SLEEPS = "import time; print('up', flush=True); time.sleep(600)"
RUNS = "print('up', flush=True)\nwhile True: pass"
RUNS_IN_A_THREAD = """\
import threading, time
def run():
    while True: pass
threading.Thread(target=run, daemon=True).start()
print('up', flush=True)
time.sleep(600)
"""
SLEEPS_IN_MANY_THREADS = """\
import threading, time
for _ in range(50):
    threading.Thread(target=time.sleep, args=(600,), daemon=True).start()
print('up', flush=True)
time.sleep(600)
"""
STARTS_THREADS = """\
import sys, threading, time
print('up', flush=True)
for line in sys.stdin:
    threads = [threading.Thread(target=time.sleep, args=(0.002,)) for _ in range(20)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    print('done', flush=True)
"""
# For each byte: a sum that takes a while, then the byte back. A thread of its own waits for it.
ANSWERS = """\
import socket, sys, threading, time
there = socket.create_connection(('127.0.0.1', int(sys.argv[1])))
def answer():
    while byte := there.recv(1):
        sum(range(300_000))
        there.sendall(byte)
threading.Thread(target=answer).start()
print('up', flush=True)
"""
# The same by a thread for each byte, beside others: the more there are, the longer it takes to look at them.
ANSWERS_IN_NEW_THREADS = """\
import _thread, socket, sys, threading, time
there = socket.create_connection(('127.0.0.1', int(sys.argv[1])))
def answer(byte):
    sum(range(300_000))
    there.sendall(byte)
def hear():
    while byte := there.recv(1):
        _thread.start_new_thread(answer, (byte,))
for _ in range(50):
    threading.Thread(target=time.sleep, args=(600,), daemon=True).start()
threading.Thread(target=hear).start()
print('up', flush=True)
"""


@contextmanager
def process(text: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", text, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True) as started:
        try:
            assert started.stdout is not None
            assert started.stdout.readline() == "up\n"
            yield started
        finally:
            started.kill()


def watched(*pids: int) -> WatchedProcesses:
    made = WatchedProcesses(spared=threading.get_native_id())
    made.watch(pids)
    return made


@pytest.mark.parametrize("text", [RUNS, RUNS_IN_A_THREAD])
def test_processes_are_quiet_when_no_thread_of_those_that_are_watched_runs(text: str) -> None:
    with process(SLEEPS) as sleeper, process(text) as runner:
        both = watched(sleeper.pid, runner.pid)
        assert not both.wait(SHORT)
        assert both.busy(SHORT) == {runner.pid}
        both.watch([sleeper.pid])
        assert both.wait(LONG)
        both.watch([sleeper.pid, runner.pid])
        assert not both.wait(SHORT)
        runner.kill()
        runner.wait()
        assert both.wait(LONG)
    # It was never there for this one.
    assert watched(runner.pid).wait(LONG)


def test_a_process_that_has_ended_and_is_not_reaped_is_quiet() -> None:
    with process("print('up', flush=True)") as ended:
        os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
        assert watched(ended.pid).wait(LONG)


# Waits for a line, and then wakes up ten times without another one.
WAKES = """\
import sys, time
print('up', flush=True)
for line in sys.stdin:
    for _ in range(10):
        time.sleep(0.001)
    print('done', flush=True)
"""


def test_processes_that_ran_since_all_were_quiet_are_counted() -> None:
    with process(SLEEPS) as sleeper, process(WAKES) as waker:
        assert waker.stdin is not None
        assert waker.stdout is not None
        both = watched(sleeper.pid, waker.pid)
        assert both.wait(LONG)
        assert both.awakenings() == {}
        waker.stdin.write("go\n")
        waker.stdin.flush()
        assert waker.stdout.readline() == "done\n"
        found = both.awakenings()
        assert set(found) == {waker.pid}
        assert found[waker.pid] >= 10
        assert both.wait(LONG)
        assert both.awakenings() == {}


def test_threads_that_come_and_go_are_followed() -> None:
    with process(STARTS_THREADS) as starter:
        assert starter.stdin is not None
        assert starter.stdout is not None
        one = watched(starter.pid)
        for _ in range(20):
            starter.stdin.write("go\n")
            starter.stdin.flush()
            while not one.wait(SHORT):
                pass
            assert starter.stdout.readline() == "done\n"
        assert one.wait(LONG)


@pytest.mark.parametrize("text", [ANSWERS, ANSWERS_IN_NEW_THREADS])
def test_who_is_woken_by_a_message_has_answered_it_when_all_is_quiet(text: str) -> None:
    """What lock-step rests on. A look that missed one moment of 200 would find no answer there."""
    with socket.create_server(("127.0.0.1", 0)) as server, process(text, str(server.getsockname()[1])) as node:
        here, _ = server.accept()
        one = watched(node.pid)
        assert one.wait(LONG)
        here.setblocking(False)
        for number in range(200):
            byte = bytes([number])
            here.sendall(byte)
            assert one.wait(LONG)
            assert here.recv(16) == byte
        here.close()


# Started with the id of a process that has more threads than this one may have files; says whether that one is quiet.
LOOKS_WITH_FEW_FILES = """\
import resource, sys, threading
resource.setrlimit(resource.RLIMIT_NOFILE, (64, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
from sim_action.ros.processes import WatchedProcesses
looking = WatchedProcesses(spared=threading.get_native_id())
looking.watch([int(sys.argv[1])])
print(looking.wait(600))
"""


def test_there_may_be_more_threads_than_files_are_usual() -> None:
    with process(SLEEPS_IN_MANY_THREADS) as sleeper:
        looking = [sys.executable, "-c", LOOKS_WITH_FEW_FILES, str(sleeper.pid)]
        assert subprocess.run(looking, capture_output=True, text=True, check=True).stdout == "True\n"


RELAYS = """\
import socket, sys, threading
before, behind = (socket.create_connection(('127.0.0.1', int(port))) for port in sys.argv[1:])
def relay():
    while byte := before.recv(1):
        sum(range(100_000))
        behind.sendall(byte)
threading.Thread(target=relay).start()
print('up', flush=True)
"""


def test_a_message_that_goes_through_several_processes_has_come_through_when_all_is_quiet() -> None:
    """Each is woken by the one before it: there is no moment between them at which all seem to wait."""
    with ExitStack() as opened:
        server = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        other = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        ports = [str(each.getsockname()[1]) for each in (server, other)]
        one = opened.enter_context(process(RELAYS, ports[0], ports[0]))
        here, middle = (opened.enter_context(server.accept()[0]) for _ in range(2))
        two = opened.enter_context(process(RELAYS, ports[1], ports[0]))
        onward, back = (opened.enter_context(each.accept()[0]) for each in (other, server))
        copier = threading.Thread(target=_copy, args=(middle, onward))
        copier.start()
        ours = watched(os.getpid(), one.pid, two.pid)
        back.setblocking(False)
        for number in range(100):
            here.sendall(bytes([number]))
            assert ours.wait(LONG)
            assert back.recv(16) == bytes([number])
        one.kill()
        copier.join()


def _copy(source: socket.socket, target: socket.socket) -> None:
    while byte := source.recv(1):
        target.sendall(byte)
