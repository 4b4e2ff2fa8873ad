"""The suite's own plugins: guards against child processes and unreached assertions."""

from __future__ import annotations

import pytest
from hypothesis import settings

from tests import reached_assertions
from tests.soak import SHORT

GUARD = ("-p", "tests.child_processes", "-p", "no:xdist", "-p", "no:cacheprovider")
REACH = ("-p", "tests.reached_assertions", "-p", "tests.soak", "-p", "no:xdist", "-p", "no:cacheprovider")


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


@pytest.fixture
def short_again() -> object:
    yield
    settings.load_profile(SHORT)


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
