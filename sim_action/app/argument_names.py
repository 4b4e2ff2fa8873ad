"""The messages of a call in a program: they name its arguments where those of the command line name options."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from types import MappingProxyType
from typing import Final

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.records import replace

_ARGUMENTS: Final = MappingProxyType(
    {
        "--allow-outside": "allow_outside",
        "--allow-scripts": "allow_scripts",
        "--backend": "backend",
        "--cluster": "cluster",
        "--exclude": "exclude",
        "--exclude-tag": "exclude_tags",
        "--fail-fast": "fail_fast",
        "--jobs": "jobs",
        "--only": "only",
        "--output-dir": "output_dir",
        "--package": "packages",
        "--pass-env": "pass_env",
        "--record": "record",
        "--repeat": "repeat",
        "--seed": "seed",
        "--tag": "tags",
    }
)
"""Options of `run`, and what `sim_action.run` calls them."""

_OPTION: Final = re.compile(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*(?![\w-])")


@contextmanager
def naming_arguments() -> Iterator[None]:
    """Name arguments in the UsageError or the InvalidScenario that the block raises."""
    try:
        yield
    except InvalidScenario as error:
        error.problems = tuple(replace(each, message=_renamed(each.message)) for each in error.problems)
        error.args = ("\n".join(map(str, error.problems)),)
        raise
    except UsageError as error:
        error.args = (_renamed(str(error)),)
        raise


def _renamed(message: str) -> str:
    return _OPTION.sub(lambda option: _ARGUMENTS.get(option[0], option[0]), message)
