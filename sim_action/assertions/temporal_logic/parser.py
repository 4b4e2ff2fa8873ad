"""The parser of formulas: text to tokens, and tokens to a Formula by precedence climbing.

From weak to strong: `implies` (right-associative), `or`, `and`, `until`, comparisons, `+ -`, `*`. `not`, `always` and
`eventually` apply to the comparison or the parenthesis that follows. Ambiguous texts are refused: `always speed < 1 and
tilt < 1` needs parentheses.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator
from types import MappingProxyType
from typing import Final, Literal, NoReturn, cast, get_args

from sim_action.assertions.sensor import why_not_picked
from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic import quoted
from sim_action.assertions.temporal_logic.formula import ALL_TIME, Formula, Interval, Relation, Term, signals
from sim_action.assertions.temporal_logic.formula_signals import (
    BASE_SIGNALS,
    FRAME_SIGNALS,
    NAMES,
    PAIR_SIGNALS,
    RATES,
    SENSOR_SIGNALS,
)
from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.core.units import TIME
from sim_action.core.wording import did_you_mean, nearest
from sim_action.robot.model.robot_model import READINGS

SIGNS: Final = MappingProxyType(
    {
        "&&": "and",
        "&": "and",
        "||": "or",
        "|": "or",
        "!": "not",
        "->": "implies",
        "=>": "implies",
        "\N{LOGICAL AND}": "and",
        "\N{LOGICAL OR}": "or",
        "\N{NOT SIGN}": "not",
        "\N{RIGHTWARDS ARROW}": "implies",
        "\N{LESS-THAN OR EQUAL TO}": "<=",
        "\N{GREATER-THAN OR EQUAL TO}": ">=",
    }
)
"""Operators of other notations -> the operator here. Of two with the same beginning, the longer comes first."""

_OPERATORS: Final = ("not", "and", "or", "implies", "always", "eventually", "until", "abs")
_OTHER_WORDS: Final = {"g": "always", "globally": "always", "f": "eventually", "finally": "eventually", "u": "until"}

# A lower cutoff would match names of signals and units.
_ALIKE: Final = 0.75
MAX_CHARACTERS: Final = 2000
KEYWORDS: Final = frozenset({"not", "and", "or", "implies", "always", "eventually", "until", "abs", "end"})
_DIMENSIONS: Final = (
    units.TIME,
    units.LENGTH,
    units.ANGLE,
    units.SPEED,
    units.ANGULAR_SPEED,
    units.ACCELERATION,
    units.FORCE,
    units.TORQUE,
)

_UNITS: Final = {symbol: (factor, kind.si) for kind in _DIMENSIONS for symbol, factor in kind.factors.items()}

# The longest match: "m/s" is not "m", and "N m" is not "N".
_UNIT: Final = "|".join(re.escape(symbol) for symbol in sorted(_UNITS, key=len, reverse=True))

# As in YAML, two quotes inside quotes are one of the name.
_QUOTED: Final = r"""'(?:[^']|'')*+'|"(?:[^"]|"")*+\""""
_NAME: Final = rf"[^\W\d]\w*+|{_QUOTED}"
_IS_QUOTED: Final = re.compile(_QUOTED)
_ARGUMENT: Final = re.compile(rf"\s*+(?:({_QUOTED})|([^,'\"]*+))\s*+(?:,|$)")
_READING: Final = "|".join((*READINGS, *PAIR_SIGNALS))

_TOKEN: Final = re.compile(
    rf"""\s*+(?:
      (?P<number>(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][-+]?[0-9]++)?+) (?:\s*+(?P<unit>{_UNIT})(?![\w/^]))?
    | (?P<reading>{_READING}) \s*+ \( \s*+ (?P<inside>(?:[^()<>'"]|{_QUOTED})*+|[^()<>]*+) \)
    | (?P<owner>{_NAME}) \. (?P<path>[^\W\d]\w*+(?:\.[^\W\d]\w*+)*+)
    | (?P<word>[^\W\d]\w*+)
    | (?P<foreign>!(?!=)|{"|".join(re.escape(sign) for sign in SIGNS if sign != "!")})
    | (?P<symbol><=|>=|==|!=|[-+*/<>()\[\],=])
    | (?P<other>\S)
    )""",
    re.VERBOSE,
)

_SHOWN: Final = 40
Kind = Literal["number", "signal", "word", "keyword", "symbol", "end"]


def operator_like(word: str) -> str | None:
    """Return the operator that a misspelt word is closest to, or None."""
    word = word.lower()
    near = difflib.get_close_matches(word[:20], _OPERATORS, n=1, cutoff=_ALIKE)
    return _OTHER_WORDS.get(word) or (near[0] if near else None)


class FormulaError(ValueError):
    """An invalid formula. The message gives place and reason; `at` is the index in the text."""

    def __init__(self, text: str, at: int, message: str) -> None:
        self.at = at
        super().__init__(f"{message}; {place(text, at)}")


def place(text: str, at: int) -> str:
    """Return a place in a text as messages show it: "at character 9, the arrow: always (-> sped < 1)"."""
    before, after = text[:at], text[at:]
    before = before if len(before) <= _SHOWN else f"...{before[-_SHOWN:]}"
    after = after if len(after) <= _SHOWN else f"{after[:_SHOWN]}..."
    return f"at character {at + 1}, the arrow: {before}-> {after}".rstrip()


@dataclass(frozen=True, slots=True)
class Token:
    """A token of the text."""

    kind: Kind
    text: str  # the text as written; for a signal of a joint, the name of the reading
    at: int  # index in the text at which it begins
    value: float = 0.0  # the SI value of a number
    unit: str = ""  # the SI symbol of a number
    joint: str = ""  # the joint of a signal
    names: tuple[str, ...] = ()  # the link, object or sensor of a signal, or several of them
    path: tuple[str, ...] = ()  # the words after the name of a link, object or sensor, which a dot separates

    def __str__(self) -> str:
        return self.text if self.kind == "end" else f"'{self.text}'"


def tokens(text: str) -> Iterator[Token]:
    """Return all tokens and an end token. Raises FormulaError."""
    if len(text) > MAX_CHARACTERS:
        message = f"the formula has {len(text)} characters; at most {MAX_CHARACTERS} are allowed"
        raise FormulaError(text, MAX_CHARACTERS, message)
    at = 0
    end = len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        assert match is not None
        yield _token(text, match)
        at = match.end()
    yield Token("end", "the end of the formula", end)


def _token(text: str, match: re.Match[str]) -> Token:
    kind = match.lastgroup
    if match["number"]:
        factor, unit = _UNITS[match["unit"]] if match["unit"] else (1.0, "")
        at = match.start("number")
        value = float(match["number"]) * factor
        if value == float("inf"):
            raise FormulaError(text, at, "a number that is too large")
        return Token("number", match[0].strip(), at, value, unit)
    if match["reading"]:
        word, inside, at = match["reading"], match["inside"].strip(), match.start("reading")
        if word in PAIR_SIGNALS:
            return Token("signal", word, at, names=_names(text, match.start("inside"), inside))
        return Token("signal", word, at, joint=_unquoted(inside) if _IS_QUOTED.fullmatch(inside) else inside)
    if match["owner"]:
        path = tuple(match["path"].split("."))
        return Token("signal", match[0].strip(), match.start("owner"), names=(_unquoted(match["owner"]),), path=path)
    assert kind is not None
    word, at = match[kind], match.start(kind)
    if kind == "foreign":
        raise FormulaError(text, at, f"{word!r} has no meaning in a formula; write '{SIGNS[word]}'")
    if kind == "other":
        raise FormulaError(text, at, f"{word!r} has no meaning in a formula")
    if kind == "word":
        return Token("keyword" if word in KEYWORDS else "word", word, at)
    return Token("symbol", word, at)


def _unquoted(name: str) -> str:
    return name[1:-1].replace(name[0] * 2, name[0]) if name[:1] in ("'", '"') else name


def _names(text: str, at: int, inside: str) -> tuple[str, ...]:
    """Return names that commas separate. Raises FormulaError."""
    names = list[str]()
    begin = 0
    while begin < len(inside):
        match = _ARGUMENT.match(inside, begin)
        if match is None:
            raise FormulaError(text, at + begin, "expected names with commas between them")
        names.append(_unquoted(match[1]) if match[1] else match[2].strip())
        begin = match.end()
    return tuple(names)


def unit_names() -> str:
    """Return all units as text for messages."""
    return ", ".join(_UNITS)


MAX_DEPTH: Final = 30  # maximum depth of nested parentheses and operators
_IMPLIES, _OR, _AND, _UNTIL, _COMPARE, _ADD, _MULTIPLY = range(1, 8)
_STRENGTH: Final = {
    "implies": _IMPLIES,
    "or": _OR,
    "and": _AND,
    "until": _UNTIL,
    **dict.fromkeys(get_args(Relation), _COMPARE),
    "+": _ADD,
    "-": _ADD,
    "*": _MULTIPLY,
}
_CONNECTIVES: Final = frozenset({"implies", "or", "and", "until"})
_NO_OPERATORS: Final = {
    "==": "signals are rarely exactly equal; bound the difference: abs(x - 1 m) < 1 cm",
    "!=": "signals are rarely exactly equal; bound the difference: abs(x - 1 m) > 1 cm",
    "=": "compare with <, <=, > or >=",
    "/": "division is not supported; multiply the other side instead",
}


# A name that is not a plain word, with a signal of a frame.
_ODD_NAME: Final = re.compile(rf"([^\W\d][\w/:.@-]*)\.({'|'.join(FRAME_SIGNALS)})\b")


def parse(text: str) -> Formula:
    """Return the formula of a text. Raises FormulaError with the place in the text."""
    return _Parser(text).formula()


def _signals_like(name: str) -> str:
    """Return the end of a message about an unknown signal of a link, an object or a sensor."""
    near = nearest(name, (*FRAME_SIGNALS, *SENSOR_SIGNALS))
    hint = "" if near is None else f"; did you mean '{near}'?"
    of_links, of_objects = sorted(FRAME_SIGNALS), sorted({*FRAME_SIGNALS}.difference(RATES))
    kinds = {"a link": of_links, "an object": of_objects, "a sensor": sorted(SENSOR_SIGNALS)}
    lists = (f"of {kind}: {', '.join(names)}" for kind, names in kinds.items())
    return f"{hint} ({'; '.join(lists)})"


class _Parser:
    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = list(tokens(text))
        self._position = 0
        self._depth = 0
        # Begin of each parenthesis -> its end.
        self._ends: dict[int, int] = {}
        # The last operator whose operands are ambiguous.
        self._open: Formula | None = None

    def formula(self) -> Formula:
        parsed = self._expression(_IMPLIES)
        if self._next.kind != "end":
            self._refuse(self._next, f"expected an operator or the end, found {self._next}{self._hint()}")
        return self._as_formula(parsed, self._tokens[0])

    @property
    def _next(self) -> Token:
        return self._tokens[self._position]

    def _advance(self) -> Token:
        token = self._next
        self._position += token.kind != "end"
        return token

    def _accept(self, *texts: str) -> Token | None:
        is_one = self._next.kind in ("symbol", "keyword") and self._next.text in texts
        return self._advance() if is_one else None

    def _expect(self, text: str, why: str) -> None:
        if self._accept(text) is None:
            self._refuse(self._next, f"expected '{text}' {why}, found {self._next}{self._hint()}")

    def _refuse(self, token: Token, message: str) -> NoReturn:
        raise FormulaError(self._text, token.at, message)

    def _hint(self) -> str:
        meant = operator_like(self._next.text) if self._next.kind == "word" else None
        return f"; did you mean '{meant}'?" if meant else self._unit_hint()

    def _unit_hint(self) -> str:
        is_unit = self._position and self._tokens[self._position - 1].kind == "number" and self._next.kind == "word"
        return f"; it is not a unit (allowed: {unit_names()})" if is_unit else ""

    def _expression(self, least: int) -> Formula | Term:
        """Parse operators that bind at least as strongly as `least`, and their operands."""
        first = self._next
        self._depth += 1
        if self._depth > MAX_DEPTH:
            self._refuse(first, f"more than {MAX_DEPTH} nested operators and parentheses")
        left = self._operand()
        while self._next.kind in ("symbol", "keyword"):
            operator = self._next
            if operator.text in _CONNECTIVES and left is self._open:
                self._ambiguous(operator)
            if operator.text in _NO_OPERATORS:
                self._refuse(operator, _NO_OPERATORS[operator.text])
            strength = _STRENGTH.get(operator.text, 0)
            if strength < least:
                break
            left = self._combined(left, first, strength)
        self._depth -= 1
        return left

    def _combined(self, left: Formula | Term, first: Token, strength: int) -> Formula | Term:
        """Parse one or several operators of the same precedence and their right operands."""
        if strength == _COMPARE:
            return self._comparison(left, first)
        if strength >= _ADD:
            return self._sum(left, first) if strength == _ADD else self._product(left, first)
        if strength == _UNTIL:
            return self._until(self._as_formula(left, first))
        operator = self._advance()
        if strength == _IMPLIES:
            premise = self._joined(left, first, operator)
            return stl.Implies(premise, self._joined_next(_IMPLIES, operator))
        items = [self._joined(left, first, operator)]
        while True:
            items.append(self._joined_next(strength + 1, operator))
            if self._accept(operator.text) is None:
                return stl.And(tuple(items)) if strength == _AND else stl.Or(tuple(items))

    def _joined_next(self, least: int, operator: Token) -> Formula:
        start = self._next
        return self._joined(self._expression(least), start, operator)

    def _joined(self, parsed: Formula | Term, first: Token, operator: Token) -> Formula:
        if isinstance(parsed, stl.Until) and parsed is self._open:
            self._ambiguous(operator)
        return self._as_formula(parsed, first)

    def _ambiguous(self, operator: Token) -> NoReturn:
        text = operator.text
        if isinstance(self._open, stl.Until):
            self._refuse(operator, f"put parentheses around 'until' next to '{text}': (... until ...) {text} ...")
        word = "always" if isinstance(self._open, stl.Always) else "eventually"
        self._refuse(
            operator, f"ambiguous without parentheses: write {word} (... {text} ...) or ({word} ...) {text} ..."
        )

    def _until(self, before: Formula) -> Formula:
        self._advance()
        interval = self._interval()
        self._open = stl.Until(before, self._formula(_COMPARE), interval)
        return self._open

    def _comparison(self, left: Formula | Term, first: Token) -> stl.Comparison:
        operator = self._advance()
        right = self._term(_ADD)
        comparison = stl.Comparison(self._as_term(left, first), cast("Relation", operator.text), right, first.at)
        if self._next.text in get_args(Relation):
            self._refuse(self._next, "comparisons cannot be chained; join two with 'and'")
        if not any(signal for term in (comparison.left, comparison.right) for signal in signals(term)):
            self._refuse(first, f"'{comparison}' is not a signal (allowed: {', '.join(NAMES)})")
        return comparison

    def _sum(self, left: Formula | Term, first: Token) -> stl.Sum:
        terms = [self._as_term(left, first)]
        while (operator := self._accept("+", "-")) is not None:
            term = self._term(_MULTIPLY)
            terms.append(term if operator.text == "+" else stl.Negative(term, operator.at))
        return stl.Sum(tuple(terms), first.at)

    def _product(self, left: Formula | Term, first: Token) -> stl.Product:
        factors = [self._as_term(left, first)]
        while self._accept("*") is not None:
            factors.append(self._term(_MULTIPLY + 1))
        return stl.Product(tuple(factors), first.at)

    def _operand(self) -> Formula | Term:
        token = self._advance()
        if token.kind in ("number", "signal", "word"):
            return self._number_or_signal(token)
        match token.text:
            case "(":
                return self._parenthesis()
            case "-":
                return stl.Negative(self._term(_MULTIPLY + 1), token.at)
            case "abs":
                return self._absolute(token)
            case "not" | "always" | "eventually":
                return self._prefixed(token)
            case _:
                return self._refuse(token, f"expected a signal, a number or a formula, found {token}")

    def _parenthesis(self) -> Formula | Term:
        begin = self._position - 1
        parsed = self._expression(_IMPLIES)
        self._expect(")", "to close the parenthesis")
        self._ends[begin] = self._position
        self._open = None
        return parsed

    def _absolute(self, token: Token) -> stl.Absolute:
        self._expect("(", "after 'abs'")
        term = self._term(_ADD)
        self._expect(")", "to close the parenthesis")
        return stl.Absolute(term, token.at)

    def _prefixed(self, token: Token) -> Formula:
        interval = ALL_TIME if token.text == "not" else self._interval()
        begin, start = self._position, self._next
        formula = self._formula(_COMPARE)
        # An operand that ends with its parenthesis is not ambiguous.
        closed = self._ends.get(begin) == self._position
        inherits = start.text in ("not", "always", "eventually")
        reaches_on = formula is self._open if inherits else not closed and token.text != "not"
        prefixed: Formula = stl.Not(formula)
        if token.text != "not":
            prefixed = stl.Always(formula, interval) if token.text == "always" else stl.Eventually(formula, interval)
        self._open = prefixed if reaches_on else None
        return prefixed

    def _interval(self) -> Interval:
        opening = self._accept("[")
        if opening is None:
            return ALL_TIME
        start = self._seconds()
        self._expect(",", "between the two times")
        end = math.inf if self._accept("end") is not None else self._seconds()
        self._expect("]", "after the two times")
        if end < start:
            self._refuse(opening, f"[{start:g} s, {end:g} s] ends before it begins; swap the two?")
        return Interval(start, end, opening.at)

    def _seconds(self) -> float:
        token = self._advance()
        if token.kind != "number" or token.unit not in ("", TIME.si):
            hint = self._unit_hint()
            self._refuse(token, f"expected a relative time such as 2 s, found {token}{hint}")
        return token.value

    def _number_or_signal(self, token: Token) -> stl.Number | stl.Signal:
        if token.kind == "number":
            return stl.Number(token.value, token.unit, token.at, " ".join(token.text.split()))
        if token.path:
            return self._dotted(token)
        if token.text in PAIR_SIGNALS:
            _, forms = PAIR_SIGNALS[token.text]
            counts = {form.count(",") + 1 if "(" in form else 0 for form in forms}
            if len(token.names) not in counts or not all(token.names):
                self._refuse(token, f"expected {' or '.join(forms)}, found {len(token.names) or 'no'} names")
            return stl.Signal(token.text, at=token.at, source="pair", names=token.names)
        if token.text in READINGS and not token.joint:
            self._refuse(token, f"name the joint: {token.text}(NAME)")
        if token.text not in READINGS and token.text not in BASE_SIGNALS:
            if (meant := operator_like(token.text)) is not None:
                self._refuse(token, f"unknown word '{token.text}'; did you mean '{meant}'?")
            hint = self._odd_name(token) or did_you_mean(token.text, NAMES)
            self._refuse(token, f"unknown signal '{token.text}'{hint}")
        return stl.Signal(token.text, token.joint, token.at)

    def _dotted(self, token: Token) -> stl.Signal:
        """Return the signal of a link, an object or a sensor."""
        (owner,), (name, *rest) = token.names, token.path
        if name in FRAME_SIGNALS and not rest:
            return stl.Signal(name, at=token.at, source="frame", names=token.names)
        if name not in SENSOR_SIGNALS:
            hint = self._odd_name(token) if rest else _signals_like(name)
            self._refuse(token, f"unknown signal '{'.'.join(token.path)}' of '{owner}'{hint}")
        which = ".".join(rest) or None
        if (trouble := why_not_picked(SENSOR_SIGNALS[name], which)) is not None:
            self._refuse(token, trouble.replace("'which': ", f"{quoted(owner)}.{name}.WHICH: "))
        return stl.Signal(name, at=token.at, source="sensor", names=(owner, *rest))

    def _odd_name(self, token: Token) -> str:
        match = _ODD_NAME.match(self._text, token.at)
        return "" if match is None else f"; write such a name in quotes: '{match[1]}'.{match[2]}"

    def _formula(self, least: int) -> Formula:
        start = self._next
        return self._as_formula(self._expression(least), start)

    def _term(self, least: int) -> Term:
        start = self._next
        return self._as_term(self._expression(least), start)

    def _as_formula(self, parsed: Formula | Term, first: Token) -> Formula:
        if isinstance(parsed, Term):
            self._refuse(first, f"'{parsed}' is not compared with anything; write, for example, {parsed} < 1")
        return parsed

    def _as_term(self, parsed: Formula | Term, first: Token) -> Term:
        if not isinstance(parsed, Term):
            self._refuse(first, f"expected a signal or a number, found the formula '{parsed}'")
        return parsed
