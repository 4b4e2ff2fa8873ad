"""The expression language, as GitHub documents it; @actions/expressions gave the same values when this was written."""

from __future__ import annotations

import math

import pytest

from tests.integration.github import Status, UnsupportedFeature, evaluate, evaluate_value, holds
from tests.integration.github.values import Known, Value

CONTEXTS: dict[str, Value] = {
    "github": {"event_name": "push", "number": 3, "yes": True, "nothing": None},
    "fruits": [{"name": "apple", "count": 1}, {"name": "pear"}, "kiwi"],
    "needs": Known(plan=Known(result="success", outputs={"n": "1"}), shard=Known(result="failure", outputs={})),
    "env": {"Path": "/bin"},
}
FAILED = Status(success=False, failure=True)


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("null", None),
        ("true", True),
        ("-9.2", -9.2),
        ("0xff", 255),
        ("-2.99e-2", -0.0299),
        ("'It''s open'", "It's open"),
        ("'${{ }}'", "${{ }}"),
        ("github.event_name", "push"),
        ("github['event_name']", "push"),
        ("github.Event_Name", "push"),
        ("env.PATH", None),
        ("env.Path", "/bin"),
        ("github.missing.deeper", None),
        ("fruits[1].name", "pear"),
        ("fruits[7]", None),
        ("fruits['1'].name", "pear"),
        ("fruits.*.name", ["apple", "pear"]),
        ("fruits[*].count", [1]),
        ("needs.*.result", ["success", "failure"]),
        ("needs.*.outputs.n", ["1"]),
        ("github.event_name.*", []),
        ("!github.nothing", True),
        ("!!'false'", True),
        ("true && 'a' || 'b'", "a"),
        ("'' || 0 || 'last'", "last"),
        ("1 == 1 && 2 < 1 || 3 >= 3", True),
        ("(false || true) && false", False),
        ("!false == true", True),
    ],
)
def test_values(expression: str, value: Value) -> None:
    assert evaluate_value(f"${{{{ {expression} }}}}", CONTEXTS) == value


@pytest.mark.parametrize(
    "expression",
    [
        "'Push' == 'pUSH'",
        "'a' < 'B'",
        "'1' == 1",
        "'' == 0",
        "' 0x10 ' == 16",
        "'0o17' == 15",
        "'1e2' == 100",
        "true == 1",
        "null == false",
        "null == ''",
        "2 > '1'",
        "1 <= true",
        "2 >= 2",
        "'Infinity' > 1e300",
        "fruits == fruits",
        "'' != 'x'",
    ],
)
def test_what_is_so(expression: str) -> None:
    assert evaluate_value(f"${{{{ {expression} }}}}", CONTEXTS) is True


@pytest.mark.parametrize(
    "expression",
    [
        "'a' == 0",
        "'one' < 2",
        "'one' >= 2",
        "NaN == NaN",
        "fruits == github",
        "fruits == 'Array'",
        "fruits < 1",
        "'1_0' == 10",
        "'0b1' == 1",
        "'0x' == 0",
        "'inf' == Infinity",
        "'nan' == 0",
    ],
)
def test_what_is_not_so(expression: str) -> None:
    assert evaluate_value(f"${{{{ {expression} }}}}", CONTEXTS) is False


@pytest.mark.parametrize(
    ("call", "value"),
    [
        ("contains('Hello world', 'LLO')", True),
        ("contains(fromJSON('[\"push\", 1]'), 'PUSH')", True),
        ("contains(fruits.*.name, 'plum')", False),
        ("contains(fruits, 'Array')", False),
        ("contains(github, 'push')", False),
        ("contains(null, '')", True),
        ("startsWith('Hello', 'he')", True),
        ("startsWith('Hello', 'lo')", False),
        ("startsWith(fruits, '')", False),
        ("ENDSWITH('Hello', 'LO')", True),
        ("endsWith(123, 3)", True),
        ("format('{{Hello {1} {0}!}}', 'a', 2)", "{Hello 2 a!}"),
        ("format('{0}', '{1}')", "{1}"),
        ("join(fruits.*.name, ', ')", "apple, pear"),
        ("join(fromJSON('[1, null, true]'))", "1,,true"),
        ("join('alone', '-')", "alone"),
        ("fromJSON('{\"a\": [1]}').a[0]", 1),
        ("fromJSON('true') && 'kept'", "kept"),
        ('toJSON(fromJSON(\'{"a":[1,"ü"]}\'))', '{\n  "a": [\n    1,\n    "ü"\n  ]\n}'),
        ("toJSON(1.5)", "1.5"),
        ("toJSON(2.0)", "2"),
    ],
)
def test_functions(call: str, value: Value) -> None:
    assert evaluate_value(f"${{{{ {call} }}}}", CONTEXTS) == value


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("no expression", "no expression"),
        ("", ""),
        ("<${{ github.event_name }}-${{github.number}}>", "<push-3>"),
        ("${{ github.yes }}${{ github.nothing }}", "true"),
        ("${{ 3.10 }} ${{ 1e21 }} ${{ -0.5 }}", "3.1 1E+21 -0.5"),
        ("${{ '}}' }} and ${{ 'it''s }}' }}", "}} and it's }}"),
        ("$ {{ }} }}", "$ {{ }} }}"),
        ("${{ NaN }}", "NaN"),
        ("${{ -Infinity }}", "-Infinity"),
    ],
)
def test_templates(template: str, text: str) -> None:
    assert evaluate(template, CONTEXTS) == text


def test_what_comes_in_is_not_looked_at_again() -> None:
    hostile = "${{ github.token }}"
    assert evaluate("<${{ inputs.a }}>", {"inputs": {"a": hostile}}) == f"<{hostile}>"


def test_one_expression_keeps_its_kind_and_text_around_it_does_not() -> None:
    assert evaluate_value("${{ github.number }}", CONTEXTS) == 3
    assert evaluate_value("${{ github.number }} ", CONTEXTS) == "3 "
    assert math.isnan(float(evaluate("${{ NaN }}", {})))


@pytest.mark.parametrize(
    "expression",
    [
        "secrets.TOKEN",
        "GITHUB.event_name",
        "needs.plam.result",
        "needs.plan.results",
        "hashFiles('**')",
        "success()",
        "contains('a')",
        "startsWith('a', 'b', 'c')",
        "format('{1}', 'a')",
        "format('{a}', 'a')",
        "fromJSON('{')",
        '"double"',
        "'open",
        "github.",
        "github.1",
        "github[",
        "fruits[1",
        "(1",
        "1 2",
        "1 +",
        "a = b",
        "join(1,)x",
        "",
    ],
)
def test_refused(expression: str) -> None:
    with pytest.raises(UnsupportedFeature):
        evaluate_value(f"${{{{ {expression} }}}}", CONTEXTS)


@pytest.mark.parametrize("template", ["${{ github.number", "${{ 'a }}", "${{ fruits }} is a list", "x${{ github }}"])
def test_templates_that_make_no_text_are_refused(template: str) -> None:
    with pytest.raises(UnsupportedFeature):
        evaluate(template, CONTEXTS)


@pytest.mark.parametrize(
    ("condition", "after_success", "after_failure"),
    [
        (None, True, False),
        (True, True, False),
        (False, False, False),
        ("github.event_name == 'push'", True, False),
        ("${{ github.event_name != 'push' }}", False, False),
        ("always()", True, True),
        ("${{ !cancelled() }}", True, True),
        ("failure()", False, True),
        ("success() || failure()", True, True),
        ("${{ failure() && github.number == 4 }}", False, False),
        ("!(Failure())", True, False),
        ("contains('always()', 'a')", True, False),
        ("github.missing", False, False),
    ],
)
def test_conditions(condition: Value, after_success: bool, after_failure: bool) -> None:
    assert holds(condition, CONTEXTS, Status()) is after_success
    assert holds(condition, CONTEXTS, FAILED) is after_failure


def test_cancelled_stops_all_but_always_and_cancelled() -> None:
    status = Status(success=False, cancelled=True)
    answers = {
        condition: holds(condition, {}, status) for condition in ("true", "always()", "cancelled()", "failure()")
    }
    assert answers == {"true": False, "always()": True, "cancelled()": True, "failure()": False}


@pytest.mark.parametrize("condition", ["${{ false }} ", "${{ false }} && true", "!${{ true }}"])
def test_conditions_that_github_takes_for_true_whatever_they_say_are_refused(condition: str) -> None:
    with pytest.raises(UnsupportedFeature):
        holds(condition, CONTEXTS, Status())
