"""Evaluates expressions as GitHub does, except that a context, function or name it does not know is refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.functions import FUNCTIONS
from tests.integration.github.syntax import Binary, Call, Context, Filter, Literal, Member, Node, Not, functions, parse
from tests.integration.github.values import Known, Value, are_equal, is_array, is_less, is_true, to_number, to_text

_OPEN, _CLOSE = "${{", "}}"
_STATUS_FUNCTIONS: Final = frozenset({"success", "failure", "cancelled", "always"})


@dataclass(frozen=True, slots=True)
class Status:
    """What success(), failure() and cancelled() say."""

    success: bool = True
    failure: bool = False
    cancelled: bool = False


def evaluate(text: str, contexts: Mapping[str, Value], status: Status | None = None) -> str:
    """Text with its `${{ }}` replaced, once: what comes in is not looked at again. Raises UnsupportedFeature."""
    return to_text(evaluate_value(text, contexts, status))


def evaluate_value(text: str, contexts: Mapping[str, Value], status: Status | None = None) -> Value:
    """The same, where more than text is taken: text that is nothing but one expression keeps its kind."""
    evaluator = _Evaluator(contexts, status)
    parts = list(_parts(text))
    if len(parts) == 1 and isinstance(parts[0], _Expression):
        return evaluator.value(parse(parts[0].text))
    return "".join(
        to_text(evaluator.value(parse(part.text))) if isinstance(part, _Expression) else part for part in parts
    )


def holds(condition: Value, contexts: Mapping[str, Value], status: Status) -> bool:
    """Whether an `if:` is true; without a status function it asks for success() as well. Raises UnsupportedFeature."""
    if condition is None:
        return status.success
    tree = parse(_condition_text(to_text(condition)))
    if _STATUS_FUNCTIONS.isdisjoint(functions(tree)):
        tree = Binary("&&", Call("success", ()), tree)
    return is_true(_Evaluator(contexts, status).value(tree))


@dataclass(frozen=True, slots=True)
class _Expression:
    text: str


class _Filtered(list[Value]):
    """What `.*` gave: a key is asked of each of them."""


def _parts(text: str) -> Iterator[str | _Expression]:
    while _OPEN in text:
        before, text = text.split(_OPEN, 1)
        if before:
            yield before
        end = _end(text)
        yield _Expression(text[:end])
        text = text[end + len(_CLOSE) :]
    if text:
        yield text


def _end(text: str) -> int:
    quoted = False
    for position, character in enumerate(text):
        quoted ^= character == "'"
        if not quoted and text.startswith(_CLOSE, position):
            return position
    raise UnsupportedFeature(f"no closing {_CLOSE}: {_OPEN}{text}")


def _condition_text(text: str) -> str:
    if _OPEN not in text:
        return text
    parts = list(_parts(text))
    if len(parts) != 1 or not isinstance(parts[0], _Expression):
        raise UnsupportedFeature(f"if: {text!r} is more than an expression, and GitHub takes that for true")
    return parts[0].text


@dataclass(frozen=True, slots=True)
class _Evaluator:
    contexts: Mapping[str, Value]
    status: Status | None

    def value(self, node: Node) -> Value:
        result: Value
        match node:
            case Literal(value):
                result = value
            case Context(name):
                result = self.context(name)
            case Member():
                result = self.member(node)
            case Filter(of):
                result = _filtered(self.value(of))
            case Call(function, arguments):
                result = self.call(function.lower(), arguments)
            case Not(operand):
                result = not is_true(self.value(operand))
            case Binary():
                result = self.binary(node)
        return result

    def context(self, name: str) -> Value:
        if name not in self.contexts:
            raise UnsupportedFeature(f"the context {name} is not there")
        return self.contexts[name]

    def member(self, node: Member) -> Value:
        # Linux knows variables by their case, and nothing else has one.
        with_case = node.of == Context("env")
        of, key = self.value(node.of), self.value(node.key)
        if isinstance(of, _Filtered):
            return _Filtered(member for item in of for member in _members(item, key, with_case=with_case))
        return next(iter(_members(of, key, with_case=with_case)), None)

    def call(self, function: str, arguments: tuple[Node, ...]) -> Value:
        if function in _STATUS_FUNCTIONS and self.status and not arguments:
            return function == "always" or bool(getattr(self.status, function))
        known = FUNCTIONS.get(function)
        if not known or not known.least <= len(arguments) <= known.most:
            raise UnsupportedFeature(f"the function {function} with {len(arguments)} arguments is not there")
        return known.call(*(self.value(argument) for argument in arguments))

    def binary(self, node: Binary) -> Value:
        left = self.value(node.left)
        if node.operator in {"&&", "||"}:
            return left if is_true(left) == (node.operator == "||") else self.value(node.right)
        return _compared(node.operator, left, self.value(node.right))


def _compared(operator: str, left: Value, right: Value) -> bool:
    match operator:
        case "==":
            return are_equal(left, right)
        case "!=":
            return not are_equal(left, right)
        case "<":
            return is_less(left, right)
        case ">":
            return is_less(right, left)
        case "<=":
            return is_less(left, right) or are_equal(left, right)
    return is_less(right, left) or are_equal(left, right)


def _filtered(of: Value) -> _Filtered:
    if isinstance(of, _Filtered):
        return _Filtered(member for item in of for member in _filtered(item))
    if isinstance(of, Mapping):
        return _Filtered(of.values())
    return _Filtered(of if is_array(of) else ())


def _members(of: Value, key: Value, *, with_case: bool) -> list[Value]:
    if isinstance(of, Mapping):
        return _values(of, to_text(key), with_case=with_case)
    index = to_number(key)
    if is_array(of) and 0 <= index < len(of):
        return [of[math.floor(index)]]
    return []


def _values(of: Mapping[str, Value], key: str, *, with_case: bool) -> list[Value]:
    found = [value for name, value in of.items() if name == key or (not with_case and name.upper() == key.upper())]
    if not found and isinstance(of, Known):
        raise UnsupportedFeature(f"{key} is none of {', '.join(sorted(of)) or 'nothing'}")
    return found
