"""What the runner reads in the log of a step, and in the files that it gives it."""

from __future__ import annotations

import pytest

from tests.integration.github import Annotation, UnsupportedFeature, parse_annotations, parse_outputs


def test_annotations_have_level_message_and_place() -> None:
    log = "::error file=a%2Cb.yml,line=3,title=x::50%25%0Aoff\n::warning::careful\n::notice line=x::hm"
    assert parse_annotations(log) == (
        Annotation("error", "50%\noff", "a,b.yml", 3),
        Annotation("warning", "careful", None, None),
        Annotation("notice", "hm", None, None),
    )


STOPPED = "::stop-commands::Tok\n::error::1\n::tokk::\n::stop-commands::x\n##[error]2\n::tok::\n::error::3\n"


@pytest.mark.parametrize(
    ("log", "messages"),
    [
        ("::error::%250A", ["%0A"]),
        # What a careless program lets through.
        ("  ::error::x", ["x"]),
        ("::ERROR::x", ["x"]),
        ("printed\r::error::x", ["x"]),
        ("printed\r\n::error::x\r\n", ["x"]),
        ("text ##[error]x", ["x"]),
        ("##[error]x", ["x"]),
        # What is no command.
        *((log, []) for log in ("text ::error::x", ":error::x", "::errors::x", "::error", "##[error x", "::::x")),
        # Nothing counts until the token comes back, which resumes only what it has stopped.
        (STOPPED, ["3"]),
        ("::tok::\n::stop-commands::tok\n::error::1\n", []),
        # Harmless commands are no annotations.
        ("::group::a\n::debug::b\n::endgroup::\n", []),
    ],
)
def test_messages_of_annotations(log: str, messages: list[str]) -> None:
    assert [annotation.message for annotation in parse_annotations(log)] == messages


@pytest.mark.parametrize("command", ["add-mask", "save-state", "echo", "set-output", "set-env", "add-path"])
def test_commands_that_are_not_known_here_are_refused(command: str) -> None:
    with pytest.raises(UnsupportedFeature, match=command):
        parse_annotations(f"::{command}::x")


def test_outputs_are_lines_and_heredocs_which_may_be_empty() -> None:
    text = "a=1=2\n\nb<<END\nx\n\ny=z\nEND\nc=x<<y\nd<<=\n1\n=\ne=\n"
    assert parse_outputs(text) == {"a": "1=2", "b": "x\n\ny=z", "c": "x<<y", "d": "1", "e": ""}
    assert parse_outputs("a<<E\nE") == {"a": ""}


@pytest.mark.parametrize("text", ["a", "=1", "<<E\nE", "a<<\n", "a<<END\nx\n"])
def test_outputs_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"neither|no closing"):
        parse_outputs(text)
