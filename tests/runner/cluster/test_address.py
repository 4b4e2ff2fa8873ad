from __future__ import annotations

import pytest

from sim_action.core.errors import UsageError
from sim_action.runner.cluster import address as module
from sim_action.runner.cluster.address import ClusterAddress


@pytest.mark.parametrize(
    ("text", "workers"),
    [
        ("local:1", 1),
        ("local:256", 256),
        ("tcp://10.0.0.5:8786", None),
        ("tls://scheduler.example:8786", None),
        ("tcp://[::1]:8786", None),
    ],
)
def test_addresses_are_those_of_schedulers_or_count_workers_here(text: str, workers: int | None) -> None:
    assert ClusterAddress.parse(text) == ClusterAddress(text, workers)


@pytest.mark.parametrize(
    "text",
    [
        "local",
        "local:0",
        "local:257",
        "local:-1",
        "tcp://host",
        "tcp://host:0",
        "tcp://host:65536",
        "host:8786",
        "tcp://",
    ],
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"such as tcp://10\.0\.0\.5:8786, or local:N with 1 to 256 workers; found"):
        ClusterAddress.parse(text)


def test_without_dask_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"distributed, which is not installed: pip install 'sim-action\[dask\]'"):
        ClusterAddress.parse("local:2")
