"""The tokens of a formula, and hints for misspelt words and other notations."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from types import MappingProxyType
from typing import Final, Literal

from sim_action.core import units
from sim_action.core.records import dataclass
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
_OTHER_WORDS: Final = {
    "g": "always",
    "globally": "always",
    "f": "eventually",
    "finally": "eventually",
    "u": "until",
}

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

PAIRS: Final = ("distance", "clearance", "force")
"""Signals between links of the robot and objects, whose names are in parentheses."""

# As in YAML, two quotes inside quotes are one of the name.
_QUOTED: Final = r"""'(?:[^']|'')*+'|"(?:[^"]|"")*+\""""
_NAME: Final = rf"[^\W\d]\w*+|{_QUOTED}"
_IS_QUOTED: Final = re.compile(_QUOTED)
_ARGUMENT: Final = re.compile(rf"\s*+(?:({_QUOTED})|([^,'\"]*+))\s*+(?:,|$)")

_TOKEN: Final = re.compile(
    rf"""\s*+(?:
      (?P<number>(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][-+]?[0-9]++)?+) (?:\s*+(?P<unit>{_UNIT})(?![\w/^]))?
    | (?P<reading>{"|".join((*READINGS, *PAIRS))}) \s*+ \( \s*+ (?P<inside>(?:[^()<>'"]|{_QUOTED})*+|[^()<>]*+) \)
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
    """A token of the text.

    Attributes:
        text: the text as written; for a signal of a joint, the name of the reading.
        at: index in the text at which it begins.
        value: the SI value of a number.
        unit: the SI symbol of a number.
        joint: the joint of a signal.
        names: the link, object or sensor of a signal, or several of them.
        path: the words after the name of a link, object or sensor, which a dot separates.
    """

    kind: Kind
    text: str
    at: int
    value: float = 0.0
    unit: str = ""
    joint: str = ""
    names: tuple[str, ...] = ()
    path: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.text if self.kind == "end" else f"'{self.text}'"


def tokens(text: str) -> Iterator[Token]:
    """Return all tokens and an end token. Raises FormulaError."""
    if len(text) > MAX_CHARACTERS:
        message = f"the formula has {len(text)} characters; at most {MAX_CHARACTERS} are allowed"
        raise FormulaError(text, MAX_CHARACTERS, message)
    at, end = 0, len(text.rstrip())
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
        if word in PAIRS:
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
    found, begin = list[str](), 0
    while begin < len(inside):
        match = _ARGUMENT.match(inside, begin)
        if match is None:
            raise FormulaError(text, at + begin, "expected names with commas between them")
        found.append(_unquoted(match[1]) if match[1] else match[2].strip())
        begin = match.end()
    return tuple(found)


def unit_names() -> str:
    """Return all units as text for messages."""
    return ", ".join(_UNITS)
