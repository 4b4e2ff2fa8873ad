"""The plugins that guard against child processes, deal tests to workers, and choose examples of property tests."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis.internal.conjecture import providers

from tests.balance import dealt

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


class Item(NamedTuple):
    path: Path
    number: int


def items(name: str, *counts: int) -> list[Any]:
    return [Item(Path(f"{name}{file}"), number) for file, count in enumerate(counts) for number in range(count)]


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_each_worker_has_whole_slow_files_and_ends_with_quick_tests(workers: int) -> None:
    slow, quick = items("slow", 16, 3, 12, 10, 12, 5, 8, 14), items("quick", *[40] * 20)
    order: list[Any] = dealt(slow, quick, workers)
    assert sorted(order) == sorted(slow + quick)
    files = [(path.name, len(list(group))) for path, group in groupby(order, key=lambda item: item.path)]
    slow_files = sorted(count for name, count in files if name.startswith("slow"))
    assert slow_files == [3, 5, 8, 10, 12, 12, 14, 16]
    for worker in range(workers):
        part = order[len(order) * worker // workers : len(order) * (worker + 1) // workers]
        kinds = ["slow" if item in slow else "quick" for item in part]
        assert 80 // workers - 10 <= kinds.count("slow") <= 80 // workers + 10
        assert set(kinds[-len(kinds) // 10 :]) == {"quick"}
        assert len(list(groupby(kinds))) > 2


def test_all_items_are_dealt_if_there_are_no_others() -> None:
    for slow, quick in ((items("slow", 9, 2), []), ([], items("quick", 9, 2)), ([], [])):
        order: list[Any] = dealt(slow, quick, 3)
        assert sorted(order) == slow + quick


def test_examples_of_property_tests_do_not_depend_on_what_is_imported() -> None:
    assert len(providers._get_local_constants()) == 0
