"""What people write who know other notations of temporal logic, or have misspelt this one."""

from __future__ import annotations

import difflib
from types import MappingProxyType
from typing import Final

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
"""A sign of another notation -> what is written here; of two that begin alike, the longer one first."""

_OPERATORS: Final = ("not", "and", "or", "implies", "always", "eventually", "until", "abs")
_OTHER_WORDS: Final = {
    "g": "always",
    "globally": "always",
    "f": "eventually",
    "finally": "eventually",
    "u": "until",
}
# Names of signals and units are nearer to some operator than this asks for.
_ALIKE: Final = 0.75


def operator_like(word: str) -> str | None:
    """The operator that a word is meant to be, if that is plain."""
    word = word.lower()
    near = difflib.get_close_matches(word[:20], _OPERATORS, n=1, cutoff=_ALIKE)
    return _OTHER_WORDS.get(word) or (near[0] if near else None)
