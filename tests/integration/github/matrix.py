"""The jobs that a matrix stands for."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

from tests.integration.github.documents import mapping, sequence
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.values import Value

_MOST_JOBS = 256


def combinations(matrix: Value) -> list[Mapping[str, Value]]:
    """One mapping a job, in GitHub's order. Raises UnsupportedFeature."""
    given = mapping(matrix, "matrix")
    if "exclude" in given:
        raise UnsupportedFeature("matrix.exclude")
    axes = {name: sequence(values, f"matrix.{name}") for name, values in given.items() if name != "include"}
    product = itertools.product(*axes.values()) if axes else ()
    jobs = _with_included(
        [dict(zip(axes, values, strict=True)) for values in product],
        [dict(mapping(entry, "include")) for entry in sequence(given.get("include", []), "include")],
    )
    if not 0 < len(jobs) <= _MOST_JOBS:
        raise UnsupportedFeature(f"a matrix of {len(jobs)} jobs")
    return jobs


def _with_included(jobs: list[dict[str, Value]], included: list[dict[str, Value]]) -> list[Mapping[str, Value]]:
    """An entry adds to every job of the product whose values it does not change, and else is a job of its own."""
    more: list[dict[str, Value]] = []
    originals = [dict(job) for job in jobs]
    for entry in included:
        fitting = [job for job, original in zip(jobs, originals, strict=True) if not _changes(entry, original)]
        for job in fitting:
            job.update(entry)
        if not fitting:
            more.append(entry)
    return [*jobs, *more]


def _changes(entry: Mapping[str, Value], original: Mapping[str, Value]) -> bool:
    return any(name in original and original[name] != value for name, value in entry.items())
