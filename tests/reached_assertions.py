"""A guard: a property test reaches each of its assertions in `LEAST_SHARE` of its examples, or fails.

An assertion that no example reaches checks nothing, and the test is green. Three things are counted in the function
that `given` decorates: an `assert`, the body of `with pytest.raises(...)`, and one element of `all(... for ...)` within
an `assert`, because `all` of nothing is true. Examples that hypothesis rejects do not count. `RARE` lists exceptions.
"""

from __future__ import annotations
import __future__

import ast
import inspect
from collections import Counter
from collections.abc import Generator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, TracebackType
from typing import Any, Final

import pytest
from _pytest.assertion.rewrite import rewrite_asserts
from hypothesis import is_hypothesis_test
from hypothesis.errors import StopTest, UnsatisfiedAssumption

LEAST_SHARE: Final = 0.2
_ANNOTATIONS: Final = __future__.annotations.compiler_flag
_LOGIC: Final = "tests/assertions/temporal_logic"
RARE: Final[dict[str, dict[str, str]]] = {
    f"{_LOGIC}/test_robustness.py::test_the_comparison_that_decides_has_the_robustness_of_the_whole": {
        "assert math.isinf(whole)": "no comparison decides only where all windows lie beyond the end of the walk"
    }
}
"""Assertions that few examples can reach, with the reason: name of the test, source of the assertion."""


@dataclass(slots=True)
class Reach:
    """The assertions of one property test, and the number of examples that reached each one."""

    assertions: list[str] = field(default_factory=list)
    examples: int = 0
    counts: Counter[int] = field(default_factory=Counter)
    _seen: set[int] = field(default_factory=set)

    def __enter__(self) -> None:
        self._seen = set()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is None or not issubclass(kind, UnsatisfiedAssumption | StopTest):
            self.examples += 1
            self.counts.update(self._seen)

    def hit(self, number: int, value: Any = None) -> Any:
        """Record that the example reached an assertion, and return `value`."""
        self._seen.add(number)
        return value

    def too_rare(self, allowed: dict[str, str]) -> list[str]:
        """Return a line for each assertion that too few examples reached."""
        return [
            f"{self.counts[number]} of {self.examples} examples reached: {assertion}"
            for number, assertion in enumerate(self.assertions)
            if self.counts[number] < LEAST_SHARE * self.examples and assertion not in allowed
        ]


class _Marks(ast.NodeTransformer):
    """Adds a call of `Reach.hit` at each assertion of a function."""

    def __init__(self, recorder: str, reach: Reach) -> None:
        self._recorder, self._reach = recorder, reach

    def _hit(self, assertion: ast.expr | ast.stmt, value: ast.expr | None = None) -> ast.Call:
        number = len(self._reach.assertions)
        self._reach.assertions.append(ast.unparse(assertion))
        method = ast.Attribute(ast.Name(self._recorder, ast.Load()), "hit", ast.Load())
        return ast.Call(method, [ast.Constant(number), *([] if value is None else [value])], [])

    def visit_Assert(self, node: ast.Assert) -> list[ast.stmt]:
        reached = ast.copy_location(ast.Expr(self._hit(node)), node)
        self.generic_visit(node)
        return [reached, node]

    def visit_Call(self, node: ast.Call) -> ast.Call:
        if isinstance(node.func, ast.Name) and node.func.id == "all" and isinstance(node.args[0], ast.GeneratorExp):
            one = node.args[0]
            one.elt = ast.copy_location(self._hit(node, one.elt), one.elt)
        return node

    def visit_With(self, node: ast.With) -> ast.With:
        manager = node.items[0].context_expr
        if isinstance(manager, ast.Call) and isinstance(manager.func, ast.Attribute) and manager.func.attr == "raises":
            node.body.insert(0, ast.copy_location(ast.Expr(self._hit(manager)), node))
            return node
        self.generic_visit(node)
        return node

    def visit_Lambda(self, node: ast.Lambda) -> ast.Lambda:
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """Leave functions inside of the test alone: they may run later, or never."""
        return node


def watch(test: FunctionType) -> Reach:
    """Replace the code of a function by one that records which assertions it reaches."""
    known = test.__globals__.get(recorder := f"@reach of {test.__qualname__}")
    if isinstance(known, Reach):
        known.examples, known.counts = 0, Counter()
        return known
    path = Path(inspect.getfile(test))
    source, functions = _functions(path)
    function = functions[test.__code__.co_firstlineno]
    reach = Reach()
    marks = _Marks(recorder, reach)
    body: list[ast.stmt] = []
    for statement in function.body:
        marked = marks.visit(statement)
        body += marked if isinstance(marked, list) else [marked]
    manager = ast.withitem(ast.Name(recorder, ast.Load()))
    function.body = [ast.copy_location(ast.With([manager], body), body[0])]
    module = ast.fix_missing_locations(ast.Module([function], []))
    rewrite_asserts(module, source, str(path))
    code = compile(module, str(path), "exec", dont_inherit=True, flags=test.__code__.co_flags & _ANNOTATIONS)
    test.__globals__[recorder] = reach
    test.__code__ = next(one for one in code.co_consts if isinstance(one, CodeType) and one.co_name == function.name)
    return reach


@cache
def _functions(path: Path) -> tuple[bytes, dict[int, ast.FunctionDef]]:
    """Return the source of a file, and its decorated functions by their first line, that of a decorator."""
    source = path.read_bytes()
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    return source, {node.decorator_list[0].lineno: node for node in functions if node.decorator_list}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    function: Any = getattr(item, "obj", None)
    if not is_hypothesis_test(function):
        return (yield)
    reach = watch(function.hypothesis.inner_test)
    ran = yield
    name = item.nodeid.partition("[")[0]
    if lines := reach.too_rare(RARE.get(name, {})):
        pytest.fail("\n".join([f"an assertion needs {LEAST_SHARE:.0%} of the examples:", *lines]), pytrace=False)
    return ran
