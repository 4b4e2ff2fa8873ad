"""`make mutants`: what is changed in a source, what is left alone, and how a change is hunted."""

from __future__ import annotations

import ast

import pytest

from tests.mutants import INTEGRATION, ROOT, equivalent
from tests.mutations import mutants


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


def test_the_files_of_integration_that_look_at_a_folder_exist() -> None:
    named = {name for names in INTEGRATION.values() for name in names.split()}
    assert {name for name in named if not (ROOT / f"tests/integration/test_{name}.py").exists()} == set()
