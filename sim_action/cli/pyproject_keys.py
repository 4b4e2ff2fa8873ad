"""The keys of `[tool.sim-action]` in pyproject.toml."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.engines import EngineOrAll

CALLER_ONLY: Final = {
    "allow-scripts": "--allow-scripts",
    "allow-outside": "--allow-outside",
    "pass-env": "--pass-env",
    "package": "--package",
    "packages": "--package",
    "resume": "--resume",
}
"""Keys that the table must not have, because a pull request can change it -> the option of the caller."""


def key_problem(path: Sequence[str | int], message: str) -> str:
    """Return the message about a key; for a key that only the caller may set, it names the option."""
    option = CALLER_ONLY.get(str(path[0])) if len(path) == 1 else None
    if option is None:
        return message
    return f"cannot be set in this file, which a pull request can change; remove it here, and use {option} instead"


class Defaults(FrozenModel):
    """The keys of the table. Each one is an option of the command line and means the same."""

    paths: Annotated[tuple[str, ...] | None, Field(min_length=1, description="scenario files, folders or globs")] = None
    backend: Annotated[EngineOrAll | None, Field(description="as --backend")] = None
    seed: Annotated[int | None, Field(ge=0, le=2**63 - 1, description="as --seed")] = None
    repeat: Annotated[int | None, Field(ge=1, le=1000, description="as --repeat")] = None
    unexercised: Annotated[Literal["error", "warn"] | None, Field(description="as --unexercised")] = None
    confidence: Annotated[Literal["numerical", "full"] | None, Field(description="as --confidence")] = None
    strict: Annotated[
        bool | None, Field(description="as --strict of run, validate, rostest, roslaunch and launchtest")
    ] = None
    jobs: Annotated[int | None, Field(ge=1, le=256, description="as --jobs")] = None
    fail_fast: Annotated[bool | None, Field(alias="fail-fast", description="as --fail-fast")] = None
    record: Annotated[tuple[str, ...] | None, Field(description="formats, as --record")] = None
    output_dir: Annotated[str | None, Field(alias="output-dir", min_length=1, description="as --output-dir")] = None
    junit: Annotated[str | None, Field(min_length=1, description="as --junit")] = None
    junit_strict: Annotated[bool | None, Field(alias="junit-strict", description="as --junit-strict")] = None
    report: Annotated[bool | None, Field(description="as --report")] = None
    summary: Annotated[bool | None, Field(description="as --summary")] = None
    annotations: Annotated[bool | None, Field(description="as --annotations")] = None
    verbose: Annotated[bool | None, Field(description="as --verbose")] = None
    quiet: Annotated[bool | None, Field(description="as --quiet")] = None
