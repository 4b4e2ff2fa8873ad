"""Actions and workflows are YAML 1.2."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.github import UnsupportedFeature
from tests.integration.github.documents import load, mapping, sequence
from tests.integration.github.values import Value


def loaded(folder: Path, text: str) -> Value:
    file = folder / "document.yml"
    file.write_text(text, encoding="utf-8")
    return dict(load(file))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("on", "on"),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("010", 10),
        ("0o10", 8),
        ("0x10", 16),
        ("-3", -3),
        ("1e3", 1000.0),
        ("3.10", 3.1),
        ("True", True),
        ("'true'", "true"),
        ("~", None),
        ("", None),
        ("[a, 1]", ["a", 1]),
        ("1.2.3", "1.2.3"),
    ],
)
def test_scalars(tmp_path: Path, text: str, value: Value) -> None:
    assert loaded(tmp_path, f"key: {text}\n") == {"key": value}


def test_keys_are_text(tmp_path: Path) -> None:
    assert loaded(tmp_path, "on: push\n1: a\n") == {"on": "push", "1": "a"}


def test_anchors_are_known_and_merge_keys_are_not(tmp_path: Path) -> None:
    document = loaded(tmp_path, "a: &x {b: 1}\nc: *x\nd:\n  <<: *x\n")
    assert document == {"a": {"b": 1}, "c": {"b": 1}, "d": {"<<": {"b": 1}}}


@pytest.mark.parametrize("text", ["a: 1\na: 2\n", "- a\n", "text\n"])
def test_documents_that_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(UnsupportedFeature):
        loaded(tmp_path, text)


def test_shapes_are_checked() -> None:
    assert mapping(None, "here") == {}
    with pytest.raises(UnsupportedFeature, match="here: the key b"):
        mapping({"a": 1, "b": 2}, "here", {"a"})
    with pytest.raises(UnsupportedFeature, match="no list"):
        sequence("text", "here")
