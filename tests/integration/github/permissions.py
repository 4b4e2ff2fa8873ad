"""What the token of a job may do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

from tests.integration.github.documents import mapping
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.values import Value, to_text

Permissions: TypeAlias = Mapping[str, str]

_SCOPES: Final = (
    *("actions", "attestations", "checks", "contents", "deployments", "discussions", "id-token", "issues"),
    *("models", "packages", "pages", "pull-requests", "repository-projects", "security-events", "statuses"),
)
_LEVELS: Final = ("none", "read", "write")
# What GitHub gives to the workflows of a new repository that ask for nothing.
DEFAULT: Final[Permissions] = {"contents": "read", "packages": "read"}


def declared(value: Value, otherwise: Permissions) -> Permissions:
    """What a workflow or job asks for; what it leaves out of a list, it does not get. Raises UnsupportedFeature."""
    if value is None:
        return otherwise
    asked = {scope: to_text(level) for scope, level in mapping(value, "permissions", _SCOPES).items()}
    if unknown := set(asked.values()) - set(_LEVELS):
        raise UnsupportedFeature(f"permissions: {', '.join(sorted(unknown))}")
    return asked


def allows(granted: Permissions, scope: str, level: str) -> bool:
    """Whether a token that was granted something may do this."""
    return _LEVELS.index(granted.get(scope, "none")) >= _LEVELS.index(level)


def limit(asked: Permissions, granted: Permissions) -> Permissions:
    """A called workflow may ask for no more than its caller has. Raises UnsupportedFeature."""
    for scope, level in asked.items():
        if not allows(granted, scope, level):
            raise UnsupportedFeature(f"permissions: '{scope}: {level}' is asked for, and the caller does not have it")
    return asked
