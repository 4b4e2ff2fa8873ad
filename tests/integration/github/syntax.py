"""The grammar of expressions: text becomes a tree."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.values import Value


@dataclass(frozen=True, slots=True)
class Literal:
    value: Value


@dataclass(frozen=True, slots=True)
class Context:
    name: str


@dataclass(frozen=True, slots=True)
class Member:
    """`of.key`."""

    of: Node
    key: str


@dataclass(frozen=True, slots=True)
class Filter:
    """`of.*`: what comes after it is asked of each."""

    of: Node


@dataclass(frozen=True, slots=True)
class Call:
    function: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Not:
    operand: Node


@dataclass(frozen=True, slots=True)
class Binary:
    operator: str
    left: Node
    right: Node


Node: TypeAlias = Literal | Context | Member | Filter | Call | Not | Binary

_TOKEN: Final = re.compile(
    r"""\s*(?:
      (?P<string>'(?:[^']|'')*')
    | (?P<name>[A-Za-z_][\w-]*)
    | (?P<operator>&&|\|\||[=!]=|[!(),.*])
    )""",
    re.VERBOSE | re.ASCII,
)
_CONSTANTS: Final = {"true": True, "false": False}
_LEVELS: Final = (("||",), ("&&",), ("==", "!="))  # what binds loosely comes first


def parse(text: str) -> Node:
    """The tree of an expression, which is given without its `${{ }}`. Raises UnsupportedFeature."""
    parser = _Parser(text, tuple(_tokens(text)))
    tree = parser.binary(0)
    if parser.peek() != "":
        raise parser.unexpected()
    return tree


def functions(node: Node) -> Iterator[str]:
    """The names of all functions that are called in a tree, in lower case."""
    match node:
        case Call(function, arguments):
            yield function.lower()
            for argument in arguments:
                yield from functions(argument)
        case Binary(_, one, other):
            yield from functions(one)
            yield from functions(other)
        case Member(one) | Filter(one) | Not(one):
            yield from functions(one)


def _tokens(text: str) -> Iterator[str]:
    position = 0
    while text[position:].strip():
        token = _TOKEN.match(text, position)
        if not token:
            raise UnsupportedFeature(f"expression {text.strip()!r}: {text[position:].strip()!r} is not understood")
        yield token[0].strip()
        position = token.end()


@dataclass(slots=True)
class _Parser:
    text: str
    tokens: tuple[str, ...]
    position: int = 0

    def peek(self) -> str:
        return self.tokens[self.position] if self.position < len(self.tokens) else ""

    def next(self) -> str:
        token = self.peek()
        self.position += 1
        return token

    def accept(self, token: str) -> bool:
        accepted = self.peek() == token
        self.position += accepted
        return accepted

    def expect(self, token: str) -> None:
        if not self.accept(token):
            raise self.unexpected()

    def unexpected(self) -> UnsupportedFeature:
        return UnsupportedFeature(f"expression {self.text.strip()!r}: {self.peek() or 'its end'!r} is not expected")

    def binary(self, level: int) -> Node:
        if level == len(_LEVELS):
            return self.unary()
        left = self.binary(level + 1)
        while self.peek() in _LEVELS[level]:
            left = Binary(self.next(), left, self.binary(level + 1))
        return left

    def unary(self) -> Node:
        return Not(self.unary()) if self.accept("!") else self.postfix()

    def postfix(self) -> Node:
        node = self.primary()
        while self.accept("."):
            node = self.dotted(node)
        return node

    def dotted(self, node: Node) -> Node:
        if self.accept("*"):
            return Filter(node)
        if not self.peek()[:1].isidentifier():
            raise self.unexpected()
        return Member(node, self.next())

    def primary(self) -> Node:
        token = self.peek()
        if token in _CONSTANTS:
            return Literal(_CONSTANTS[self.next()])
        if token.startswith("'"):
            return Literal(self.next()[1:-1].replace("''", "'"))
        if token[:1].isidentifier():
            return self.named()
        raise self.unexpected()

    def named(self) -> Node:
        name = self.next()
        return Call(name, self.arguments()) if self.accept("(") else Context(name)

    def arguments(self) -> tuple[Node, ...]:
        arguments: list[Node] = []
        while not self.accept(")"):
            if arguments:
                self.expect(",")
            arguments.append(self.binary(0))
        return tuple(arguments)
