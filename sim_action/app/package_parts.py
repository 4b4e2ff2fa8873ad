"""The assertions and sensors of installed packages, for lists, explanations and schemas."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from sim_action.core.permissions import scripts_refused
from sim_action.core.registry import InstalledPart, PackageProblem, Table


def package_parts(table: Table[Any]) -> Iterator[tuple[InstalledPart, type[BaseModel] | PackageProblem]]:
    """Yield the parts that installed packages add to a table, each with its class or the reason why there is none.

    Nothing is imported where code of the repository is refused.
    """
    refused = scripts_refused("auto", os.environ, (Path.cwd(),)) if table.installed() else None
    for name, part in table.installed().items():
        try:
            yield part, PackageProblem(f"{part} is not imported: {refused}") if refused else table.load(name)
        except PackageProblem as problem:
            yield part, problem
