"""The style check finds each kind of violation, and none in what follows the rules."""

from __future__ import annotations

import click
import pytest

from tools.style import (
    MAX_FOLDER_MODULES,
    MAX_MODULE_LINES,
    docstring_violations,
    help_violations,
    name_violations,
    size_violations,
    violations,
    wording_violations,
)


@pytest.mark.parametrize(
    "source",
    [
        '"""What it is."""',
        'def f():\n    """Whether it is."""',
        'class C:\n    def f(self):\n        """Of many."""',
        'LIMIT = 3\n"""How many there may be."""',
    ],
)
def test_docstrings_start_with_a_verb_or_a_noun(source: str) -> None:
    (found,) = docstring_violations("a.py", source)
    assert found.startswith(f"a.py:{source.count(chr(10)) + 1}: start the docstring with ")


@pytest.mark.parametrize("source", ["", '"""Whatsapp messages."""', 'def f():\n    """Return what is left."""\n'])
def test_other_docstrings_pass(source: str) -> None:
    assert list(docstring_violations("a.py", source)) == []


def test_help_texts_are_there_and_plain() -> None:
    @click.group(help="Run tests.")
    @click.option("--seed", help="Seed, whatever they say.")
    @click.option("--quiet", is_flag=True)
    def program() -> None: ...

    @program.command(help="Of one run.")
    @click.option("--only", help="Name of a scenario.")
    @click.option("--report", help="Run and tell the result.")
    def show() -> None: ...

    assert list(help_violations(program, "x")) == [
        "x --seed: avoid 'whatever' in the help text",
        "x --quiet: write a help text",
        "x show: avoid 'Of' in the help text",
        "x show --report: avoid 'tell' in the help text",
    ]


def test_modules_and_folders_have_a_size() -> None:
    fits = {f"a/m{number}.py": MAX_MODULE_LINES for number in range(MAX_FOLDER_MODULES)}
    assert list(size_violations(fits)) == []
    assert list(size_violations(fits | {"a/long.py": MAX_MODULE_LINES + 1})) == [
        f"a/long.py:1: {MAX_MODULE_LINES + 1} lines; a module has at most {MAX_MODULE_LINES}",
        f"a: {MAX_FOLDER_MODULES + 1} modules; a folder has at most {MAX_FOLDER_MODULES}",
    ]


def test_a_check_of_no_files_is_a_violation() -> None:
    assert "sim_action, action, tools: no Python file found, nothing was checked there" in violations([])


@pytest.mark.parametrize(
    ("good", "bad", "advice"),
    [
        ("problems = f()", "found = f()", "name the thing; 'found' can be anything"),
        ("for part in parts: ...", "for each in parts: ...", "name the thing; 'each' can be anything"),
        ("def f(pose): ...", "def f(given): ...", "name the thing; 'given' can be anything"),
        ("def poses(): ...", "def _found(): ...", "name the thing; '_found' can be anything"),
        ("a = 1  # the limit", "a = 1  # that of the limit", "avoid 'that of' in docstrings and comments"),
        ('"""The rest."""', '"""Return what\nis left."""', "avoid 'what is' in docstrings and comments"),
        (
            '"""See the page."""',
            '"""See Engine.step."""',
            "use @override without a docstring in place of 'See Engine.step.'",
        ),
        ("a, b = b, a", "a, b = f(), 1", "assign unrelated values one by one, not as a tuple"),
        ("a, b = f(1), f(2)", "a, b = f(1), g(2)", "assign unrelated values one by one, not as a tuple"),
        ("a, b = min(c), max(c)", "a, b = min(c), len(c)", "assign unrelated values one by one, not as a tuple"),
    ],
)
def test_names_docstrings_comments_and_tuples(good: str, bad: str, advice: str) -> None:
    for text, advices in ((good, []), (bad, [f"a.py:1: {advice}"])):
        checks = (docstring_violations, name_violations, wording_violations)
        assert [problem for check in checks for problem in check("a.py", f"{text}\n")] == advices
