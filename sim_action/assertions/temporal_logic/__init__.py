"""Temporal logic: conditions over time, judged online with an early decision.

- `combination`: `any_of`, `all_of`, `at_once`, `not`.
- `formula`, `parser`, `robustness`, `monitor`: signal temporal logic (`stl`). `parse` turns text into a Formula.

The robustness of a formula at a step is its distance to the opposite truth value (Fainekos and Pappas 2009, Donze and
Maler 2010). Windows are cut at the last step. An empty window has robustness +inf for `always`, -inf for `eventually`
and `until`.
"""

import re
from typing import Final

_PLAIN_NAME: Final = re.compile(r"[^\W\d]\w*")


def quoted(name: str) -> str:
    """Return a name as a formula writes it: in quotes, unless it is a plain word."""
    return name if _PLAIN_NAME.fullmatch(name) else "'" + name.replace("'", "''") + "'"
