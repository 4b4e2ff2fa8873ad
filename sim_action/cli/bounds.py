"""The type of options that are numbers within bounds."""

from __future__ import annotations

from typing import Any

import click
from typing_extensions import override

from sim_action.core.wording import shown


class Bounded(click.ParamType):  # type: ignore[type-arg] # generic in new versions of click only
    """A number within bounds; its errors are plain words.

    click lists bounds in `--help` and in errors as `[0<=x<=9223372036854775807]`. This type hides them in `--help`.
    """

    def __init__(self, number: click.IntRange | click.FloatRange) -> None:
        """Take the type that checks the bounds."""
        self.name = number.name
        self._number = number

    @override
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return self._number.convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected {self._allowed}, found {shown(value)}", param, ctx)

    @property
    def _allowed(self) -> str:
        """The allowed numbers, such as "a whole number from 1 to 256"."""
        number = self._number
        noun = "a whole number" if isinstance(number, click.IntRange) else "a number"
        if number.max is None:
            return f"{noun} {'greater than' if number.min_open else 'of at least'} {number.min}"
        if number.min_open:
            return f"{noun} greater than {number.min} and at most {number.max:,.0f}"
        return f"{noun} from {number.min} to {number.max}"
