"""Property tests ask the same questions on every run, and never how long an answer took.

What is about PyBullet, or takes its robots, has the marker `pybullet`, and is skipped where PyBullet is not installed.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
import time
from collections.abc import Generator, Iterator

import pytest

from sim_action.core.process import BEFORE_IMPORTS
from sim_action.engines import installed
from sim_action.ros.ros2.installation import PYTHON_VARIABLE
from tests.ros.ros2.nodes import WHEELS

pytest_plugins = ["pytester", "tests.soak", "tests.child_processes", "tests.balance", "tests.reached_assertions"]
_M_ARENA_MAX = -8  # a parameter of mallopt(3)
_MAX_THREAD_S = 10.0  # the wait for the end of a thread
_LASTING = set[threading.Thread]()  # those that did not end by then


@pytest.fixture(autouse=True, scope="session")
def cache_of_the_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What is kept between runs is not the user's, and ROS 2 is the one of `make test`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        # As the command line does: interpreters with several threads cannot be forked for user code.
        patch.setenv("OPENBLAS_NUM_THREADS", BEFORE_IMPORTS["OPENBLAS_NUM_THREADS"])
        if WHEELS.exists() and PYTHON_VARIABLE not in os.environ:
            patch.setenv(PYTHON_VARIABLE, str(WHEELS))
        yield


def pytest_xdist_auto_num_workers() -> int:
    """Three for each processor: tests that start processes wait more than they compute."""
    return (os.cpu_count() or 1) * 3


def pytest_configure() -> None:
    """Reserve no address space for each thread that a test had: runs that are forked have a limit of it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Never look for garbage among the tests: all of them stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_teardown() -> Generator[None, object, object]:
    """Wait for the end of all threads of a test: a process with threads is not forked for the runs of the next one."""
    ended = yield
    end = time.monotonic() + _MAX_THREAD_S
    while (left := set(threading.enumerate()) - {threading.current_thread()} - _LASTING) and time.monotonic() < end:
        time.sleep(0.001)
    _LASTING.update(left)
    return ended


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("pybullet") and "pybullet" not in installed():
        pytest.skip("PyBullet is not installed; it has wheels for Linux x86-64 with Python 3.11 alone")
