"""A guard: a test outside of tests/integration that starts a process has the marker `process`, or fails.

`make check` runs all tests that have neither that marker nor that folder, and so it stays quick.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest

_STARTS: Final = frozenset(
    {
        "subprocess.Popen",
        "os.exec",
        "os.fork",
        "os.forkpty",
        "os.posix_spawn",
        "os.spawn",
        "os.startfile",
        "os.system",
        "pty.spawn",
    }
)
"""Audit events of Python, raised by whatever function starts a process."""

_INTEGRATION: Final = f"{Path(__file__).parent / 'integration'}{os.sep}"


class _Watch:
    """The starts that were seen since the watch began; None while nothing is watched."""

    starts: list[str] | None = None


# To load a scenario with a policy starts a short one.
_CHECK_OF_NETWORKS: Final = [sys.executable, "-P", "-m", "sim_action.networks.network_check"]


def _see(event: str, arguments: tuple[object, ...]) -> None:
    if event in _STARTS and _Watch.starts is not None and arguments[1:2] != (_CHECK_OF_NETWORKS,):
        _Watch.starts.append(f"{event} {arguments[0]!r}" if arguments else event)


# A hook cannot be removed again; outside of a watch this one does nothing.
sys.addaudithook(_see)


@contextmanager
def _guarded(item: pytest.Item) -> Iterator[None]:
    if may_start_processes(item):
        yield
        return
    outer, starts = _Watch.starts, list[str]()
    _Watch.starts = starts
    try:
        yield
    finally:
        _Watch.starts = outer
    if starts:
        pytest.fail(f"it starts a process ({starts[0]}), and does not have the marker 'process'", pytrace=False)


def may_start_processes(item: pytest.Item) -> bool:
    """Return True if the test has the marker `process` or lies in tests/integration."""
    return str(item.path).startswith(_INTEGRATION) or item.get_closest_marker("process") is not None


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "process: starts a process; not part of `make check`")
    # Python starts `uname` at the first call, and keeps the answer.
    platform.processor()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    with _guarded(item):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    with _guarded(item):
        return (yield)
