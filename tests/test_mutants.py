"""`make mutants`: what is changed in a source, what is left alone, and how a change is hunted."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.mutants import ROOT, Copy, Hunt, drawn, equivalent, stages
from tests.mutations import Mutant, mutants


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


def test_a_sample_is_the_same_for_a_seed_and_comes_from_every_folder() -> None:
    begins = "sim_action/s"
    sample = drawn(30, 1, begins)
    assert sample == drawn(30, 1, begins)
    assert sample != drawn(30, 2, begins)
    assert len({(mutant.file, mutant.line) for mutant in sample}) == 30
    assert {mutant.file.split("/")[1] for mutant in sample} == {"scenario", "sensors", "simulation", "state"}


def test_equivalent_mutants_are_known_by_text_and_are_not_drawn() -> None:
    table = equivalent()
    for entry in table:
        text = (ROOT / entry["file"]).read_text(encoding="utf-8")
        there = {mutant.difference() for mutant in mutants(entry["file"], text)}
        assert (entry["line"], entry["becomes"]) in there, f"no longer a mutant: {entry}"
        assert entry["reason"]
    assert len({(entry["file"], entry["line"], entry["becomes"]) for entry in table}) == len(table)


def test_the_tests_of_a_module_come_first() -> None:
    near, folder, integration, whole = stages("sim_action/results/comparison.py")
    assert near[0] == "tests/results/test_comparison.py"
    assert "tests/reports/test_comparison.py" in near
    assert folder[0] == "tests/results"
    assert "tests/results/test_comparison.py" in folder
    assert all((ROOT / file).is_file() for file in integration)
    assert whole[-2:] == ("--ignore", "tests/results")


@pytest.mark.process
def test_a_mutant_is_noticed_by_the_first_test_that_fails_only_because_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = "def positive(a):\n    return a > 0\n"
    tests = "from it import positive\ndef test_bad(): assert 0\ndef test_one(): assert positive(1)\n"
    for name in ("root", "copy", "clean"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "it.py").write_text(source)
        (tmp_path / name / "test_it.py").write_text(tests)
    monkeypatch.setattr("tests.mutants.ROOT", tmp_path / "root")
    monkeypatch.setattr("tests.mutants.stages", lambda _: iter([("test_it.py",)]))
    hunt, copy = Hunt(Copy(tmp_path / "clean")), Copy(tmp_path / "copy")
    at = source.index(">")
    assert hunt.noticed_by(Mutant("it.py", 2, at, at + 1, "<", source), copy) == "test_it.py::test_one"
    assert hunt.noticed_by(Mutant("it.py", 2, at, at + 1, ">=", source), copy) is None
    assert hunt.fails_anyway == {"test_it.py::test_bad"}
    assert (tmp_path / "copy/it.py").read_text() == source
