"""The plugin that guards against child processes."""

from __future__ import annotations

import pytest

GUARD = ("-p", "tests.child_processes", "-p", "no:xdist", "-p", "no:cacheprovider")


@pytest.mark.process
@pytest.mark.parametrize(
    ("start", "event"),
    [
        ("subprocess.run(['true'])", "subprocess.Popen 'true'"),
        ("os.waitpid(os.posix_spawn('/bin/true', ['true'], {}), 0)", "os.posix_spawn '/bin/true'"),
        ("os.system('true')", "os.system b'true'"),
        ("os._exit(0) if not (child := os.fork()) else os.waitpid(child, 0)", "os.fork"),
        ("subprocess.getoutput('true')", "subprocess.Popen '/bin/sh'"),
    ],
)
def test_a_test_that_starts_a_process_says_so(pytester: pytest.Pytester, start: str, event: str) -> None:
    pytester.makepyfile(
        "import os, subprocess, pytest\n"
        f"def test_unmarked(): {start}\n"
        "@pytest.mark.process\n"
        f"def test_marked(): {start}\n"
        "def test_quick(): pass\n"
        "@pytest.fixture\n"
        f"def child(): {start}\n"
        "def test_with_a_fixture(child): pass\n"
    )
    ran = pytester.runpytest_inprocess(*GUARD)
    ran.assert_outcomes(passed=2, failed=1, errors=1)
    ran.stdout.fnmatch_lines([f"it starts a process ({event}), and does not have the marker 'process'"])
