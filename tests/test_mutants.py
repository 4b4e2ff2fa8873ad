"""`make mutants`: what is changed in a source, what is left alone, and how a change is hunted."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.mutants import ROOT, Copy, Failure, Hunt, equivalent
from tests.mutations import Mutant, mutants
from tests.reached_places import durations_s, insert_probes, reaching, with_probes


def made(source: str) -> list[str]:
    found = [mutant.applied() for mutant in mutants("a.py", source)]
    for text in found:
        ast.parse(text)
    return found


@pytest.mark.parametrize(
    ("source", "others"),
    [
        ("a < b", ["a <= b", "a >= b"]),
        ("a >= b", ["a > b", "a < b"]),
        ("a == b != c", ["a != b != c", "a == b == c"]),
        ("a is not b", ["a is b"]),
        ("a not in b", ["a in b"]),
        ("(a + b) * (\n c)", ["(a - b) * (\n c)", "(a + b) / (\n c)"]),
        ("a - -b", ["a + -b", "a - b"]),
        ("a ** b // c", ["a * b // c", "a ** b * c"]),
        ("a += b", ["a -= b"]),
        ("a and b or c", ["a or b or c", "a and b and c"]),
        ("not a", ["a"]),
        ("not (a == b)", ["not (a != b)", "(a == b)"]),
        ("-(a)", ["(a)"]),
        ("a[0]", ["a[(-1)]", "a[1]"]),
        ("a = 2.5", ["a = 3.5"]),
        ("f(a=True)", ["f(a=False)", "pass"]),
        ("if a: b = c", ["if not (a): b = c"]),
        ("a if b else c", ["a if not (b) else c"]),
        ("while a:\n    continue", ["while a:\n    break", "while not (a):\n    continue"]),
        ("while True:\n    break", ["while False:\n    break", "while True:\n    continue"]),
        ("def f(): return 'ä', a", ["def f(): return None"]),
        ("é = 'ä' + a", ["é = 'ä' - a"]),
        ("a | b", ["a & b"]),
    ],
)
def test_a_source_is_changed_in_one_place_at_a_time(source: str, others: list[str]) -> None:
    assert sorted(made(source)) == sorted(others)


@pytest.mark.parametrize(
    "source",
    [
        "'''1 + 1'''",
        "assert a < b",
        "a: Literal[1] = b",
        "a: Literal[1]",
        "def f(a: b[1] = c) -> d[1]: pass",
        "@d(frozen=True)\nclass A: pass",
        "@d(1)\ndef f(): pass",
        "f'{a + 1}'",
        "if TYPE_CHECKING: import a",
        "A = B | C\na = d(a, int | e.F)\ng = h | None",
        "def f(): return\ndef g(): return None",
        "a # <\\\n",
        "MAX_A: Final = 200",
        "_MAX_WAIT_S: Final = 0.5",
        "b = cast(A[1], c)",
        "b = zip(a, c, strict=True)",
        "time.sleep(a)",
    ],
)
def test_what_no_test_could_notice_is_left_alone(source: str) -> None:
    assert made(source) == []


def test_a_mutant_knows_its_line_and_how_it_changes() -> None:
    source = "a = 'ä'\n\nif a:\n    b = c + 1  # why\n"
    found = mutants("a.py", source)
    assert [mutant.line for mutant in found] == [3, 4, 4, 4]
    assert found[1].difference() == ("b = c + 1  # why", "b = c - 1  # why")


def test_equivalent_mutants_are_known_by_text_and_are_not_drawn() -> None:
    table = equivalent()
    for entry in table:
        text = (ROOT / entry["file"]).read_text(encoding="utf-8")
        there = {mutant.difference() for mutant in mutants(entry["file"], text)}
        assert (entry["line"], entry["becomes"]) in there, f"no longer a mutant: {entry}"
        assert entry["reason"]
    assert len({(entry["file"], entry["line"], entry["becomes"]) for entry in table}) == len(table)


def test_a_probe_stands_before_the_statement_of_a_place() -> None:
    source = (
        "A = 1\n\ndef f(a):\n    'é'\n    if a:\n        pass\n    elif a + A:\n        return (\n            a - 1)\n"
        "    @g\n    def h(b=2): return b\n"
    )
    places = [(number, source.encode().index(text)) for number, text in enumerate((b"+", b"-", b"1", b"2"))]
    mark = '__import__("sim_action.reached").reached.mark({})'.format
    ast.parse(probed := with_probes(source, places))
    lines = source.splitlines()
    for line, probe in ((9, f"    {mark(3)}"), (7, f"        {mark(1)}"), (4, f"    {mark(0)}; {mark(2)}")):
        lines.insert(line, probe)
    assert probed.splitlines() == lines
    assert with_probes("A = 1\n", [(0, 4)]) == f"{mark(0)}\nA = 1\n"


@pytest.mark.process
def test_a_place_knows_the_tests_that_reach_it_in_any_process(tmp_path: Path) -> None:
    mutant = Mutant("sim_action/a.py", 2, 17, 18, "2", source := "def f():\n    a = 1\n")
    (tmp_path / "sim_action").mkdir()
    for name, text in (("__init__", ""), ("a", source)):
        (tmp_path / f"sim_action/{name}.py").write_text(text)
    insert_probes(tmp_path, [mutant, mutant])
    for test in ("tests/b.py::c (call)", "tests/d.py::e[ (] (setup)", "of_pytester.py::a (setup)"):
        command = [sys.executable, "-c", "from sim_action.a import f; f(); f()"]
        subprocess.run(command, cwd=tmp_path, env={"PYTEST_CURRENT_TEST": test}, check=True)
    tests = durations_s(
        "0.10s call     tests/b.py::c\n0.20s setup    tests/d.py::e[ (]\n0.30s call     tests/d.py::e[ (]\n"
    )
    assert tests == {"tests/b.py::c": 0.1, "tests/d.py::e[ (]": 0.5}
    assert reaching(tmp_path, 1, tests) == {"", *tests, "tests/d.py"}
    assert reaching(tmp_path, 2, tests) == set()


@pytest.mark.parametrize(
    ("with_it", "without", "noticed"),
    [
        (["a", "a"], [None], "a"),
        (["a", "b", "b"], ["a", None], "b"),
        (["a", None, "b", "b"], [None, None], "b"),
        ([None], [], None),
    ],
    ids=["fails twice", "fails anyway", "fails once", "passes"],
)
def test_a_failure_counts_that_comes_again_and_not_without_the_mutant(
    tmp_path: Path, with_it: list[str | None], without: list[str | None], noticed: str | None
) -> None:
    class Scripted(Copy):
        def first_failure(self, tests: Sequence[str], *_: str) -> Failure | None:
            test = (with_it if self.folder == tmp_path else without).pop(0)
            assert test is None or test in tests
            return Failure(test, "") if test else None

    mutant = Mutant("a.py", 1, 4, 5, "2", "a = 1\n")
    failure = Hunt(Scripted(tmp_path / "clean")).noticed_by(mutant, [["a", "b"]], Scripted(tmp_path))
    assert (failure and failure.test) == noticed
    assert with_it == without == []
    assert (tmp_path / "a.py").read_text() == "a = 1\n"
