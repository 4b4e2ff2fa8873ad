"""Evaluates expressions as GitHub does, except that a context, function or name it does not know is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.syntax import Binary, Call, Context, Filter, Literal, Member, Node, Not, functions, parse
from tests.integration.github.values import Known, KnownOutputs, Value, are_equal, is_array, is_true, to_text

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
        of = self.value(node.of)
        if isinstance(of, _Filtered):
            return _Filtered(member for item in of for member in _members(item, node.key, with_case=with_case))
        return next(iter(_members(of, node.key, with_case=with_case)), None)

    def call(self, function: str, arguments: tuple[Node, ...]) -> Value:
        if function in _STATUS_FUNCTIONS and self.status and not arguments:
            return function == "always" or bool(getattr(self.status, function))
        match function, [self.value(argument) for argument in arguments]:
            case "join", [items, separator] if is_array(items):
                return to_text(separator).join(to_text(item) for item in items)
            case "fromjson", [text]:
                return _from_json(to_text(text))
        raise UnsupportedFeature(f"the function {function} with {len(arguments)} arguments is not there")

    def binary(self, node: Binary) -> Value:
        left = self.value(node.left)
        if node.operator in {"&&", "||"}:
            return left if is_true(left) == (node.operator == "||") else self.value(node.right)
        return are_equal(left, self.value(node.right)) == (node.operator == "==")


def _from_json(text: str) -> Value:
    try:
        value: Value = json.loads(text)
    except json.JSONDecodeError as error:
        raise UnsupportedFeature(f"fromJSON of {text!r}: {error}") from error
    return value


def _filtered(of: Value) -> _Filtered:
    if not isinstance(of, Mapping):
        raise UnsupportedFeature(f"`.*` of {of!r}")
    return _Filtered(of.values())


def _members(of: Value, key: str, *, with_case: bool) -> list[Value]:
    if not isinstance(of, Mapping):
        return []
    found = [value for name, value in of.items() if name == key or (not with_case and name.upper() == key.upper())]
    if not found and isinstance(of, Known | KnownOutputs):
        raise UnsupportedFeature(f"{key} is none of {', '.join(sorted(of)) or 'nothing'}")
    return found
