"""Long repetitions: `make test` runs a short form of each, `make soak` (`pytest --soak`) the long one.

Two kinds of tests run under `--soak`, and nothing else: those with the marker `soak`, and property tests. A property
test then tries `FACTOR` times as many examples as without, and other ones on every run.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

FACTOR: Final = 40  # examples of a property test under `--soak`, for each example of `make test`
EXAMPLES: Final = 25  # examples of a property test in `make test` that states no number
SHORT: Final = "sim-action"
LONG: Final = "sim-action-soak"
_SLOW: Final = [HealthCheck.too_slow]

settings.register_profile(SHORT, deadline=None, derandomize=True, max_examples=EXAMPLES, suppress_health_check=_SLOW)
settings.register_profile(LONG, settings.get_profile(SHORT), derandomize=False, max_examples=FACTOR * EXAMPLES)


def examples(count: int) -> settings:
    """Return the settings of a property test: half of `count` examples, and `FACTOR` times that under `--soak`."""
    long = settings.get_current_profile_name() == LONG
    return settings(max_examples=-(-count // 2) * (FACTOR if long else 1))


def soaked(values: Iterable[Any], short: Iterable[Any]) -> list[Any]:
    """Return values for `parametrize`; those that are not in `short` are tried under `--soak` alone."""
    kept = list(short)
    return [value if value in kept else _long(value) for value in values]


def _long(value: Any) -> Any:
    values = value if isinstance(value, tuple) else (value,)
    return pytest.param(*values, marks=pytest.mark.soak)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--soak", action="store_true", help="run the long repetitions: tests marked 'soak' and property tests"
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "soak: a long repetition, run with --soak alone; a short form runs without")
    settings.load_profile(LONG if config.getoption("soak") else SHORT)
    if not config.getoption("soak"):
        # It draws constants from all modules of ours that are imported: examples would depend on the tests before.
        providers._get_local_constants = Constants


# After hypothesis has marked its tests.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    long = bool(config.getoption("soak"))
    chosen, dropped = list[pytest.Item](), list[pytest.Item]()
    for item in items:
        (chosen if _runs(item, long=long) else dropped).append(item)
    if dropped:
        config.hook.pytest_deselected(items=dropped)
        items[:] = chosen


def _runs(item: pytest.Item, *, long: bool) -> bool:
    marked = item.get_closest_marker("soak") is not None
    return marked or item.get_closest_marker("hypothesis") is not None if long else not marked
