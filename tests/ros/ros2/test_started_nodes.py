"""The start of the nodes that a scenario lists."""

from __future__ import annotations

import pytest
import yaml

from sim_action.ros.ros2.started_nodes import parameter_file


@pytest.mark.parametrize("text", ["1e3", "nan", "infinity", "0x1p3", "yes", "1", "", "a b", "caf\u00e9", "x " * 80])
def test_a_parameter_that_is_a_text_stays_one(text: str) -> None:
    written = parameter_file({"label": text, "labels": [text]})

    assert written.count(': "') + written.count('- "') == 2
    assert yaml.safe_load(written) == {"/**": {"ros__parameters": {"label": text, "labels": [text]}}}


def test_numbers_and_booleans_are_not_quoted() -> None:
    assert parameter_file({"a": {"gains": [1.5, 2.0], "on": True}}) == (
        '"/**":\n  "ros__parameters":\n    "a":\n      "gains":\n      - 1.5\n      - 2.0\n      "on": true\n'
    )
