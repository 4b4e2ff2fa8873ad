"""The suite's own plugins: guards against child processes and unreached assertions, repetitions, the order."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import settings

from tests import reached_assertions
from tests.balance import dealt
from tests.soak import EXAMPLES, FACTOR, LONG, SHORT, examples, soaked

GUARD = ("-p", "tests.child_processes", "-p", "no:xdist", "-p", "no:cacheprovider")
REACH = ("-p", "tests.reached_assertions", "-p", "tests.soak", "-p", "no:xdist", "-p", "no:cacheprovider")
SOAK = ("-p", "tests.soak", "-p", "no:xdist", "-p", "no:cacheprovider")


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


TESTS = """\
import pytest
from hypothesis import given, settings, strategies
from tests.soak import examples, soaked

asked = []

@examples(3)
@given(strategies.integers())
def test_property(number):
    asked.append(number)

def test_plain():
    assert len(set(asked)) <= 3

@pytest.mark.soak
def test_long():
    pass

@pytest.mark.parametrize("value", soaked("abc", short="b"))
def test_some(value):
    pass
"""


@pytest.fixture
def short_again() -> object:
    yield
    settings.load_profile(SHORT)


def test_long_repetitions_run_when_they_are_asked_for(pytester: pytest.Pytester, short_again: object) -> None:
    pytester.makepyfile(TESTS)
    short = pytester.runpytest_inprocess(*SOAK, "-v")
    short.assert_outcomes(passed=3, deselected=3)
    short.stdout.fnmatch_lines(["*::test_property PASSED*", "*::test_plain PASSED*", "*::test_some[[]b[]] PASSED*"])
    long = pytester.runpytest_inprocess(*SOAK, "-v", "--soak")
    long.assert_outcomes(passed=4, deselected=2)
    long.stdout.fnmatch_lines(["*::test_property PASSED*", "*::test_long PASSED*", "*::test_some[[]a[]] PASSED*"])


def test_properties_are_asked_more_often_and_differently_in_a_long_repetition(short_again: object) -> None:
    settings.load_profile(SHORT)
    assert (examples(7).max_examples, settings().max_examples, settings().derandomize) == (4, EXAMPLES, True)
    settings.load_profile(LONG)
    assert (examples(7).max_examples, settings().max_examples, settings().derandomize) == (
        4 * FACTOR,
        EXAMPLES * FACTOR,
        False,
    )


def test_values_that_are_not_in_the_short_form_are_marked() -> None:
    first, second = soaked(["a", "b"], short=["a"])
    assert first == "a"
    assert (second.values, [mark.name for mark in second.marks]) == (("b",), ["soak"])


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
def test_every_worker_begins_with_slow_tests_and_ends_with_quick_ones(workers: int) -> None:
    slow, quick = [f"slow {number}" for number in range(11)], [f"quick {number}" for number in range(40)]
    order = dealt(slow, quick, workers)
    assert sorted(order) == sorted([*slow, *quick])
    bounds = [len(order) * worker // workers for worker in range(workers + 1)]
    for begin, end in pairwise(bounds):
        part = order[begin:end]
        assert part[0].startswith("slow")
        assert part[-1].startswith("quick")
        assert part == [*(one for one in part if one in slow), *(one for one in part if one in quick)]


@pytest.mark.parametrize(("slow", "quick"), [(10, 0), (0, 10), (9, 1), (0, 0), (2, 1)])
def test_no_test_is_lost_however_many_are_slow(slow: int, quick: int) -> None:
    items = [f"slow {number}" for number in range(slow)], [f"quick {number}" for number in range(quick)]
    assert sorted(dealt(*items, 4)) == sorted([*items[0], *items[1]])


PROPERTIES = """\
import pytest
from hypothesis import assume, given, settings, strategies as st

numbers = st.integers(0, 99)

def parsed(number):
    if number > 1:
        raise ValueError
    return [number] * number

@given(numbers)
def test_always(number):
    \"\"\"The name of a test may be in its own text.\"\"\"
    assert number >= 0
    with pytest.raises(IndexError):
        [][number]

@given(numbers)
def test_seldom(number):
    try:
        found = parsed(number)
    except ValueError:
        assert number
    else:
        assert len(found) == number

@given(numbers)
def test_all_of_nothing(number):
    assert all(one > number for one in [])

@given(numbers)
def test_in_a_loop(number):
    for one in []:
        assert one

@given(numbers)
def test_in_no_context(number):
    if number < 0:
        with pytest.raises(IndexError):
            [][number]

@pytest.mark.parametrize("least", [0, 50])
@given(number=numbers)
def test_rejected(least, number):
    assume(number >= least)
    if number >= 50 or not least:
        assert number >= least

@given(number=numbers, data=st.data())
def test_draws(number, data):
    other = data.draw(st.just(number).filter(lambda one: one % 2))
    assert other == number

@given(numbers)
def test_wrong(number):
    assert number * 2 < 3
"""


def test_a_property_test_reaches_each_assertion(pytester: pytest.Pytester, short_again: object) -> None:
    pytester.makepyfile(test_reach=PROPERTIES)
    ran = pytester.runpytest_inprocess(*REACH)
    ran.assert_outcomes(passed=4, failed=5)
    ran.stdout.fnmatch_lines(
        [
            "*test_seldom*",
            "an assertion needs 20% of the examples:",
            "* of 25 examples reached: assert len(found) == number",
            "*test_all_of_nothing*",
            "0 of 25 examples reached: all((one > number for one in []))",
            "*test_in_a_loop*",
            "0 of 25 examples reached: assert one",
            "*test_in_no_context*",
            "0 of 25 examples reached: pytest.raises(IndexError)",
            "*test_wrong*",
            # As pytest explains any assertion.
            "E*assert (2 [*] 2) < 3",
            "test_reach.py:*: AssertionError",
        ]
    )
    ran.stdout.no_fnmatch_line("*examples reached: assert number*")


def test_a_known_exception_may_be_rare(
    pytester: pytest.Pytester, short_again: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(test_reach=PROPERTIES)
    rare = {"assert len(found) == number": "two of a hundred numbers"}
    monkeypatch.setitem(reached_assertions.RARE, "test_reach.py::test_seldom", rare)
    pytester.runpytest_inprocess(*REACH, "-k", "seldom").assert_outcomes(passed=1, deselected=8)
