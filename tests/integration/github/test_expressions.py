"""The expression language, as GitHub documents it; @actions/expressions gave the same values when this was written."""

from __future__ import annotations

import pytest

from tests.integration.github import Status, evaluate, evaluate_value, holds
from tests.integration.github.values import Known, Value

CONTEXTS: dict[str, Value] = {
    "github": {"event_name": "push", "number": 3, "share": 3.10, "yes": True, "nothing": None},
    "fruits": ["kiwi"],
    "needs": Known(plan=Known(result="success", outputs={"n": "1"}), shard=Known(result="failure", outputs={})),
    "env": {"Path": "/bin"},
}
FAILED = Status(success=False, failure=True)


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("true", True),
        ("'It''s open'", "It's open"),
        ("'${{ }}'", "${{ }}"),
        ("github.event_name", "push"),
        ("github.Event_Name", "push"),
        ("env.PATH", None),
        ("env.Path", "/bin"),
        ("github.missing.deeper", None),
        ("needs.*.result", ["success", "failure"]),
        ("needs.*.outputs.n", ["1"]),
        ("!github.nothing", True),
        ("!!'false'", True),
        ("true && 'a' || 'b'", "a"),
        ("'' || github.nothing || 'last'", "last"),
        ("!false == true", True),
        ("true || false && false", True),
        ("'Push' == 'pUSH'", True),
        ("'' != 'x'", True),
        ("'1.0' == '1'", False),
        ("true == false", False),
        ("true != false", True),
        ("github.nothing == ''", True),
        ("github.nothing == 'x'", False),
        ("'x' != github.missing", True),
        ("join(needs.*.result, ', ')", "success, failure"),
        ("JOIN(fromJSON('[1, null, true]'), ',')", "1,,true"),
        ("fromJSON('{\"a\": [1]}').a", [1]),
        ("fromJSON('true') && 'kept'", "kept"),
    ],
)
def test_values_comparisons_and_functions(expression: str, value: Value) -> None:
    result = evaluate_value(f"${{{{ {expression} }}}}", CONTEXTS)
    assert (result, isinstance(result, bool)) == (value, isinstance(value, bool))


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("no expression", "no expression"),
        ("", ""),
        ("<${{ github.event_name }}-${{github.number}}>", "<push-3>"),
        ("${{ github.yes }}${{ github.nothing }} ${{ github.share }}", "true 3.1"),
        ("${{ '}}' }} and ${{ 'it''s }}' }}", "}} and it's }}"),
        ("$ {{ }} }}", "$ {{ }} }}"),
    ],
)
def test_templates(template: str, text: str) -> None:
    assert evaluate(template, CONTEXTS) == text


def test_what_comes_in_is_not_looked_at_again() -> None:
    assert evaluate("<${{ inputs.a }}>", {"inputs": {"a": "${{ github.token }}"}}) == "<${{ github.token }}>"


def test_one_expression_keeps_its_kind_and_text_around_it_does_not() -> None:
    assert evaluate_value("${{ github.number }}", CONTEXTS) == 3
    assert evaluate_value("${{ github.number }} ", CONTEXTS) == "3 "


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
        ("${{ failure() && github.nothing }}", False, False),
        ("!Failure()", True, False),
        ("'always()'", True, False),
        ("github.missing", False, False),
    ],
)
def test_conditions(condition: Value, after_success: bool, after_failure: bool) -> None:
    assert holds(condition, CONTEXTS, Status()) is after_success
    assert holds(condition, CONTEXTS, FAILED) is after_failure


def test_cancelled_stops_all_but_always_and_cancelled() -> None:
    status = Status(success=False, cancelled=True)
    expected = {"true": False, "always()": True, "cancelled()": True, "failure()": False}
    assert {condition: holds(condition, {}, status) for condition in expected} == expected
