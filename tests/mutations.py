"""Small changes of a Python source that a test should notice: see `tests.mutants`."""

from __future__ import annotations

import ast
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

_COMPARISONS: Final[dict[type[ast.cmpop], tuple[str, tuple[str, ...]]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
_OPERATORS: Final[dict[type[ast.operator], tuple[str, str]]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitOr: ("|", "&"),
    ast.BitAnd: ("&", "|"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
_LARGE: Final = 50
_Span = tuple[int, int]
_Change = tuple[_Span, str]


@dataclass(frozen=True, slots=True, order=True)
class Mutant:
    """A change of one place: the bytes from `start` to `end` of a file's `source` become `text`."""

    file: str
    line: int
    start: int
    end: int
    text: str
    source: str = field(repr=False, compare=False)

    def applied(self) -> str:
        data = self.source.encode()
        return (data[: self.start] + self.text.encode() + data[self.end :]).decode()

    def difference(self) -> tuple[str, str]:
        """Return the lines that change, before and after, without the spaces around them."""
        data = self.source.encode()
        start = data.rfind(b"\n", 0, self.start) + 1
        end = data.find(b"\n", self.end)
        end = len(data) if end < 0 else end
        after = data[start : self.start] + self.text.encode() + data[self.end : end]
        return data[start:end].decode().strip(), after.decode().strip()


def mutants(file: str, source: str) -> list[Mutant]:
    """Return all mutants of a source, in order."""
    return sorted(set(_Finder(file, source).found(ast.parse(source))))


class _Finder:
    def __init__(self, file: str, source: str) -> None:
        self._file = file
        self._source, self._data = source, source.encode()
        self._lines = [0, *(match.end() for match in re.finditer(b"\n", self._data))]

    def found(self, node: ast.AST) -> Iterator[Mutant]:
        """Yield the mutants of a node and of all in it that is run, and no more than a type or a message."""
        if isinstance(node, ast.expr | ast.stmt):
            for changes in (self._other_signs, self._other_values, self._other_ways):
                for (start, end), text in changes(node):
                    yield Mutant(self._file, bisect_right(self._lines, start), start, end, text, self._source)
        for child in _run(node):
            if not _is_choice(child):
                yield from self.found(child)

    def _other_signs(self, node: ast.expr | ast.stmt) -> Iterator[_Change]:
        match node:
            case ast.Compare(left, ops, comparators):
                for before, op, after in zip((left, *comparators), ops, comparators, strict=False):
                    sign, others = _COMPARISONS[type(op)]
                    for other in others:
                        yield from self._between(before, after, sign, other)
            case ast.BinOp(left, op, right) if type(op) in _OPERATORS and not _is_type(node):
                yield from self._between(left, right, *_OPERATORS[type(op)])
            case ast.AugAssign(target, op, value) if type(op) in _OPERATORS:
                yield from self._between(target, value, *(f"{sign}=" for sign in _OPERATORS[type(op)]))
            case ast.BoolOp(op, values):
                signs = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
                for before, after in pairwise(values):
                    yield from self._between(before, after, *signs)

    def _other_values(self, node: ast.expr | ast.stmt) -> Iterator[_Change]:
        match node:
            case ast.UnaryOp(ast.Not() | ast.USub(), operand):
                yield (self._span(node)[0], self._span(operand)[0]), "" if self._at(operand, -1) != b"(" else "("
            case ast.Constant(value) if isinstance(value, bool):
                yield self._span(node), str(not value)
            case ast.Constant(value) if isinstance(value, int | float):
                yield self._span(node), repr(value + 1)
                if isinstance(value, int):
                    yield self._span(node), f"({value - 1})" if value < 1 else repr(value - 1)
            case ast.Return(ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
                yield self._span(value), "None"

    def _other_ways(self, node: ast.expr | ast.stmt) -> Iterator[_Change]:
        match node:
            case ast.If(ast.Constant() | ast.Name("TYPE_CHECKING")) | ast.While(ast.Constant()):
                return
            case ast.If(test) | ast.While(test) | ast.IfExp(test):
                yield self._span(test), f"not ({self._text(test)})"
            case ast.Continue():
                yield self._span(node), "break"
            case ast.Break():
                yield self._span(node), "continue"
            case ast.Expr(ast.Call(ast.Attribute(ast.Name("time"), "sleep"))):
                return
            case ast.Expr(ast.Call()):
                yield self._span(node), "pass"

    def _between(self, before: ast.expr, after: ast.expr, sign: str, other: str) -> Iterator[_Change]:
        start, end = self._span(before)[1], self._span(after)[0]
        gap = self._data[start:end]
        if b"#" not in gap and gap.count(sign.encode()) == 1:
            at = start + gap.index(sign.encode())
            yield (at, at + len(sign)), other

    def _at(self, node: ast.expr, offset: int) -> bytes:
        start = self._span(node)[0] + offset
        return self._data[start : start + 1]

    def _text(self, node: ast.expr) -> str:
        start, end = self._span(node)
        return self._data[start:end].decode()

    def _span(self, node: ast.expr | ast.stmt) -> _Span:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._lines[node.lineno - 1] + node.col_offset, self._lines[node.end_lineno - 1] + node.end_col_offset


def _is_choice(node: ast.AST) -> bool:
    """Return True for a named constant that might as well be a bit more: a large number, or a time to wait."""
    match node:
        case ast.AnnAssign(ast.Name(name), value=ast.Constant(value)) if name.isupper():
            is_large = isinstance(value, int) and value >= _LARGE
            return is_large or name.endswith(("_WAIT_S", "_TIMEOUT_S", "_POLL_S", "_EVERY_S"))
        case _:
            return False


def _is_type(node: ast.BinOp) -> bool:
    """Return True for a union of types."""
    ends = (node.left, node.right)
    names = [end.value if isinstance(end, ast.Subscript) else end for end in ends]
    return isinstance(node.op, ast.BitOr) and any(
        (isinstance(name, ast.Name | ast.Attribute) and ast.unparse(name).rpartition(".")[2][:1].isupper())
        or (isinstance(name, ast.Name) and name.id in {"int", "float", "str", "bytes", "bool", "dict", "tuple", "list"})
        or (isinstance(name, ast.Constant) and name.value is None)
        for name in names
    )


def _run(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the children of a node that are run; not types, decorators, `assert`, f-strings and TYPE_CHECKING."""
    match node:
        case ast.Assert() | ast.JoinedStr():
            return
        case ast.If(ast.Name("TYPE_CHECKING")):
            yield from node.orelse
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            yield from (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body)
        case ast.ClassDef():
            yield from node.body
        case ast.AnnAssign(value=ast.expr() as value):
            yield value
        case ast.AnnAssign():
            return
        case ast.Call(ast.Name("cast" | "TypeVar")):
            return
        case ast.Call(ast.Name("zip")):
            # `strict` guards against mistakes of our own.
            yield from node.args
        case _:
            yield from ast.iter_child_nodes(node)
