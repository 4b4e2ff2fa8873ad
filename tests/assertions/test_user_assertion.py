"""Classes of the user's that judge a run."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.user_assertion import History, UserAssertion
from sim_action.core.errors import ScriptError
from sim_action.core.workspace import Workspace
from sim_action.simulation.panel import Panel
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world.scene import Scene
from tests.traces import START, contact, expectation, piece, scenario, scene, trace

P, H, B = State.PENDING, State.HOLDS, State.BROKEN

SLOW = """\
from sim_action import Verdict

class Slow:
    kind = "{kind}"
    def __init__(self, limit=0.75):
        self.limit = limit
    def judge(self, trace):
        fastest = trace.speed.max()
        when = trace.time[trace.speed.argmax()]
        return Verdict(fastest <= self.limit, fastest, self.limit, self.limit - fastest, "m/s", when, "fast")
"""


@pytest.fixture(autouse=True)
def search_path() -> Iterator[None]:
    """A class may import its neighbours: in a process of its own. Here it must not last."""
    before = list(sys.path)
    yield
    sys.path[:] = before


def ride() -> Trace:
    return trace([1.0, 2.0, 3.0, 4.0], x=[1.0, 2.0, 3.0, 4.0], speed=[0.5, 1.0, 0.5, 0.25])


def here(folder: Path) -> Scene:
    there = scene()
    return Scene(there.robot, there.model, there.world, there.physics, Workspace(folder, folder))


def written(folder: Path, text: str, **settings: Any) -> UserAssertion:
    (folder / "checks.py").write_text(text, encoding="utf-8")
    return UserAssertion.model_validate({"class": "checks.py:Slow", "with": settings})


def opened(folder: Path, text: str, **settings: Any) -> Monitor:
    return written(folder, text, **settings).monitor(here(folder), START)


def judging(body: str) -> str:
    return f"import numpy as np\nimport sim_action as sim\n\nclass Slow:\n    def judge(self, trace):\n        {body}\n"


def refusal(folder: Path, text: str, **settings: Any) -> ScriptError:
    with pytest.raises(ScriptError) as raised:
        opened(folder, text, **settings).observe(ride()).verdict()
    return raised.value


def states(folder: Path, text: str) -> list[State]:
    monitor = opened(folder, text)
    found = [monitor.state]
    for index in range(len(ride())):
        monitor = monitor.observe(piece(ride(), index, index + 1))
        found.append(monitor.state)
    return found


def test_it_judges_the_whole_run_however_it_is_cut(tmp_path: Path) -> None:
    monitor = opened(tmp_path, SLOW.format(kind="end"), limit=1.25)
    expected = Verdict(True, 1.0, 1.25, 0.25, "m/s", 2.0, "fast")
    for cuts in ([0, 4], [0, 1, 2, 3, 4], [0, 0, 3, 4]):
        fold = monitor
        for start, end in pairwise(cuts):
            fold = fold.observe(piece(ride(), start, end))
        assert fold.verdict() == expected
        assert {type(value) for value in (fold.verdict().measured, fold.verdict().time)} == {float}
        assert type(fold.verdict().passed) is bool
    # No moment is no pass.
    verdict = monitor.observe(trace([])).verdict()
    assert (verdict.passed, verdict.message) == (False, "no physics step to measure")


@pytest.mark.parametrize(
    ("kind", "expected"), [("end", [H, H, H, H, H]), ("invariant", [H, H, B, B, B]), ("goal", [P, H, H, H, H])]
)
def test_its_kind_says_when_it_is_asked(tmp_path: Path, kind: str, expected: list[State]) -> None:
    assert states(tmp_path, SLOW.format(kind=kind)) == expected


def test_a_trace_is_not_changed_by_who_judges_it(tmp_path: Path) -> None:
    error = refusal(tmp_path, judging("trace.time[0] = 1.0"))
    assert str(error) == "Slow.judge() raised ValueError: assignment destination is read-only"
    assert error.location is not None
    assert error.location.line == 6


def test_what_was_decided_stands(tmp_path: Path) -> None:
    """A goal that came true is not judged again, though it would not pass now."""
    fold = opened(tmp_path, SLOW.format(kind="goal"))
    for index in range(4):
        fold = fold.observe(piece(ride(), index, index + 1))
    assert fold.verdict().passed
    assert fold.verdict().time == 1.0


def test_the_panel_finds_the_moment_by_asking_about_shorter_runs(tmp_path: Path) -> None:
    spec = written(tmp_path, SLOW.format(kind="invariant"))
    panel, seen = Panel.open(scenario(expectation(spec)), here(tmp_path), START).observe_until_end(ride())
    assert (panel.end, len(seen)) == ("expectation failed", 2)
    (verdict,) = panel.verdicts()
    assert (verdict.passed, verdict.time) == (False, 2.0)


@pytest.mark.parametrize("kind", ["end", "invariant", "goal"])
def test_what_never_judged_is_not_exercised(tmp_path: Path, kind: str) -> None:
    text = judging("pass").replace("def judge", f"kind = {kind!r}\n\n    def judge")
    told = Window(opened(tmp_path, text)).observe(ride())
    assert told.state is (State.PENDING if kind == "goal" else State.HOLDS)
    assert told.verdict().status == "not_exercised"
    assert told.verdict().message == "Slow.judge() returned None: it judged nothing; return a sim_action.Verdict"


def test_what_has_nothing_to_judge_at_first_is_judged_later(tmp_path: Path) -> None:
    text = judging("return sim.Verdict(True) if len(trace) > 2 else None")
    waiting = opened(tmp_path, text.replace("def judge", "kind = 'goal'\n\n    def judge")).observe(ride().first(2))
    assert waiting.state is State.PENDING
    assert waiting.observe(ride().rows(slice(2, None))).state is State.HOLDS


def test_a_verdict_needs_no_more_than_whether_it_passed_and_a_message_is_one_printable_line(tmp_path: Path) -> None:
    text = judging("return sim.Verdict(bool(trace.time[-1] > 3))")
    assert opened(tmp_path, text).observe(ride()).verdict() == Verdict(passed=True, message="holds")
    text = judging(r"return sim.Verdict(False, message='a\n::error::b\x1b[31m')")
    assert opened(tmp_path, text).observe(ride()).verdict().message.isprintable()


@pytest.mark.parametrize(
    ("body", "message", "line"),
    [
        ("return 1 / 0", "Slow.judge() raised ZeroDivisionError: division by zero", 6),
        ("raise SystemExit", "Slow.judge() raised SystemExit", 6),
        ("return True", "Slow.judge() returned a bool; it returns a sim_action.Verdict or None", 5),
        ("return sim.Verdict('yes')", "a Verdict whose 'passed' is 'yes'; it is True or False", 5),
        ("return sim.Verdict(True, float('nan'))", "a Verdict whose 'measured' is nan; it is a finite number", 5),
        ("return sim.Verdict(True, margin=np.inf)", "a Verdict whose 'margin' is inf; it is a finite number", 5),
        ("return sim.Verdict(True, time='1 s')", "a Verdict whose 'time' is '1 s'; it is a finite number", 5),
        ("return sim.Verdict(True, limit=True)", "a Verdict whose 'limit' is true; it is a finite number", 5),
        ("return sim.Verdict(True, 5.0, 1.0, -4.0)", "a Verdict that passed with the margin -4; a margin below 0", 5),
        ("return sim.Verdict(True, 10**400)", "Slow.judge() returned a Verdict whose 'measured' is 1000", 5),
        ("return sim.Verdict(True, 10**5000)", "what Slow.judge() returned raised ValueError: Exceeds", None),
        ("return sim.Verdict(True, message=Sly('x'))", "what Slow.judge() returned raised RuntimeError: sly", 10),
        ("return sim.Verdict(True, unit=3)", "a Verdict whose 'unit' or 'message' is not a string", 5),
    ],
)
def test_what_it_raises_or_answers_is_an_error_at_its_line(
    tmp_path: Path, body: str, message: str, line: int | None
) -> None:
    sly = "\nclass Sly(str):\n    def __getitem__(self, index):\n        raise RuntimeError('sly')\n"
    error = refusal(tmp_path, judging(body) + sly)
    assert message in str(error)
    assert error.location is not None
    assert (error.location.file, error.location.line) == (str(tmp_path / "checks.py"), line)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 / 0", "the file of Slow raised ZeroDivisionError"),
        ("Slow = 3", "Slow is not a class with a method judge(self, trace)"),
        ("class Slow: pass", "Slow is not a class with a method judge(self, trace)"),
        (
            "class M(type):\n    def __getattr__(self, name):\n        1 / 0\nclass Slow(metaclass=M): ...",
            "Slow raised ZeroDivisionError",
        ),
        ("class Slow:\n    kind = 'always'\n    def judge(self, trace): ...", "Slow.kind is 'always'; allowed: end,"),
        (
            "class Slow:\n    def __init__(self):\n        raise ValueError('no')\n    def judge(self, trace): ...",
            "Slow(...), called with its settings, raised ValueError: no",
        ),
    ],
)
def test_what_cannot_be_made(tmp_path: Path, text: str, message: str) -> None:
    assert message in str(refusal(tmp_path, text))


def test_a_setting_that_it_does_not_take_is_told_and_lists_among_them_are_lists(tmp_path: Path) -> None:
    assert "unexpected keyword argument 'limt'" in str(refusal(tmp_path, SLOW.format(kind="end"), limt=3))
    text = "class Slow:\n    def __init__(self, x): assert x == [1, {'a': [2]}], x\n    def judge(self, trace): ...\n"
    opened(tmp_path, text, x=(1, {"a": (2,)}))


def test_a_setting_is_compared_with_the_signature_before_the_run(tmp_path: Path) -> None:
    def problems(**settings: Any) -> list[tuple[tuple[str | int, ...], str]]:
        return list(written(tmp_path, SLOW.format(kind="end"), **settings).file_problems(Workspace(tmp_path, tmp_path)))

    assert problems(limit=3) == []
    ((path, message),) = problems(limt=3)
    assert path == ("with", "limt")
    assert "class 'Slow' has no parameter 'limt'; did you mean 'limit'? (allowed: limit)" in message
    text = "class Slow:\n    def __init__(self, limit): ...\n    def judge(self, trace): ...\n"
    found = list(written(tmp_path, text).file_problems(Workspace(tmp_path, tmp_path)))
    assert found == [((), "checks.py:2: class 'Slow' requires 'limit'; add it to 'with'")]


def test_it_is_read_and_not_run_before(tmp_path: Path) -> None:
    spec = written(tmp_path, SLOW + "\nopen('ran', 'w')\nraise SystemExit\n")
    assert list(spec.file_problems(Workspace(tmp_path, tmp_path))) == []
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("checks.py:Slo", "checks.py defines no class 'Slo'; did you mean 'Slow'?"),
        ("nothing.py:Slow", "'nothing.py' does not exist"),
        ("../x.py:Slow", "is outside the workspace"),
        ("broken.py:Slow", "broken.py:1: not valid Python"),
    ],
)
def test_problems_with_the_file(tmp_path: Path, name: str, message: str) -> None:
    written(tmp_path, SLOW)
    (tmp_path / "broken.py").write_text("class")
    ((path, told),) = UserAssertion.model_validate(name).file_problems(Workspace(tmp_path, tmp_path))
    assert path == ()
    assert message in told


@pytest.mark.parametrize("name", ["checks.py", ":Slow", "checks.py:", ""])
def test_a_name_without_file_or_class(name: str) -> None:
    with pytest.raises(ValidationError, match="expected a file and a class"):
        UserAssertion.model_validate(name)


MOMENTS = 40
COUNTED = [float(n) for n in range(MOMENTS)]
SEEN = trace(COUNTED, x=COUNTED, contacts=[contact(3.0), contact(30.0)])


def grown(cuts: list[int], history: History | None = None) -> list[History]:
    """After each of the pieces between the cuts."""
    found = []
    for start, end in pairwise(cuts):
        following = piece(SEEN, start, end)
        history = History.of(following) if history is None else history.followed_by(following)
        found.append(history)
    return found


def same(one: Trace, other: Trace) -> bool:
    return np.array_equal(one.state, other.state) and one.contacts == other.contacts


@given(st.lists(st.integers(0, MOMENTS)).map(sorted))
def test_it_is_the_trace_however_that_is_cut(cuts: list[int]) -> None:
    for history, end in zip(grown([0, *cuts]), cuts, strict=True):
        assert same(history.whole(), piece(SEEN, 0, end))


def test_what_follows_a_moment_twice_does_not_change_what_followed_first() -> None:
    (early,) = grown([0, 10])
    first, *_ = grown([10, 20], early)
    other = early.followed_by(piece(SEEN, 30, 40))
    assert same(first.whole(), piece(SEEN, 0, 20))
    assert other.whole().time.tolist() == [*range(10), *range(30, 40)]
    assert len(early.whole()) == 10


def test_most_of_it_is_copied_once_or_twice_whatever_its_length() -> None:
    wholes = [history.whole().state for history in grown(list(range(MOMENTS)))]
    moved = sum(not np.shares_memory(before, after) for before, after in pairwise(wholes))
    assert 0 < moved <= math.log2(MOMENTS)


HIGH = """\
from sim_action import Verdict

class Slow:
    def judge(self, trace):
        scan, wheel = trace.links["base_scan"], trace.between(2.0, 3.0).links["wheel_left_link"]
        seen = scan.seen_from(trace.links["base_footprint"])
        assert (len(scan), len(wheel), len(trace.links)) == (4, 2, 5)
        assert abs(seen.position_xyz - seen.position_xyz[0]).max() < 1e-12
        assert scan.linear_xyz[1, 0] == 1.0
        return Verdict(scan.position_xyz[-1, 0] > 3.9, message=", ".join(trace.links))
"""


def test_a_class_reads_the_motion_of_links(tmp_path: Path) -> None:
    verdict = opened(tmp_path, HIGH).observe(ride()).verdict()
    assert verdict.passed
    assert "caster_back_link" in verdict.message
    with pytest.raises(ScriptError, match="the robot has no link 'scan'; did you mean 'base_scan'"):
        opened(tmp_path, HIGH.replace('links["base_scan"]', 'links["scan"]')).observe(ride()).verdict()


def test_only_a_class_of_the_users_needs_the_motion_of_all_links() -> None:
    assert dict(ride().links) == {}
