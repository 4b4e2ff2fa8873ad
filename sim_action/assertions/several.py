"""A list of assertions as the value of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

from pydantic import Field

from sim_action.assertions import Assertion
from sim_action.assertions.combined import Combined, Place, short
from sim_action.core.messages import shown


class Several(Combined):
    """What `any_of` and `all_of` have in common."""

    parts: Annotated[tuple[Assertion, ...], Field(min_length=1, description="the list itself, which is the value")]

    @classmethod
    def entries(cls, data: Any) -> Sequence[tuple[Place, Any]]:
        """See Combined.entries."""
        if not isinstance(data, tuple) or not data:
            raise ValueError(f"expected a list of assertions, each of which begins with '- ', found {shown(data)}")
        return [((index,), entry) for index, entry in enumerate(data)]

    @classmethod
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        """See Combined.made_of."""
        return cls(parts=parts)

    @classmethod
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        """See Combined.value_schema."""
        return {"type": "array", "minItems": 1, "items": part}

    @property
    def placed_parts(self) -> Sequence[tuple[Place, Assertion]]:
        """See Combined.placed_parts."""
        return [((index,), part) for index, part in enumerate(self.parts)]

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return short(f"{self.key}: {'; '.join(part.inner_title for part in self.parts)}")

    @property
    def inner_title(self) -> str:
        """In parentheses: else what follows would read as one part more."""
        return f"({self.title})"
