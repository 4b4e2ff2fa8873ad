"""What the runner reads in the log of a step, and in the files that it gives it."""

from __future__ import annotations

import pytest

from tests.integration.github import Annotation, UnsupportedFeature, parse_annotations, parse_outputs


def messages(log: str) -> list[str]:
    return [annotation.message for annotation in parse_annotations(log)]


def test_annotations_have_level_message_and_place() -> None:
    log = "::error file=a%2Cb.yml,line=3,title=x::50%25%0Aoff\n::warning::careful\n::notice line=x::hm"
    assert parse_annotations(log) == (
        Annotation("error", "50%\noff", "a,b.yml", 3),
        Annotation("warning", "careful", None, None),
        Annotation("notice", "hm", None, None),
    )


def test_an_escaped_escape_stays_one() -> None:
    assert messages("::error::%250A") == ["%0A"]


@pytest.mark.parametrize(
    "log",
    ["  ::error::x", "::ERROR::x", "printed\r::error::x", "printed\r\n::error::x\r\n", "text ##[error]x", "##[error]x"],
)
def test_what_a_careless_program_lets_through(log: str) -> None:
    assert messages(log) == ["x"]


@pytest.mark.parametrize("log", ["text ::error::x", ":error::x", "::errors::x", "::error", "##[error x", "::::x"])
def test_what_is_no_command(log: str) -> None:
    assert messages(log) == []


def test_nothing_counts_until_the_token_comes_back() -> None:
    log = "::stop-commands::Tok\n::error::1\n::tokk::\n::stop-commands::x\n##[error]2\n::tok::\n::error::3\n"
    assert messages(log) == ["3"]


def test_a_token_resumes_only_what_it_has_stopped() -> None:
    assert messages("::tok::\n::stop-commands::tok\n::error::1\n") == []


@pytest.mark.parametrize("command", ["add-mask", "save-state", "echo", "set-output", "set-env", "add-path"])
def test_commands_that_are_not_known_here_are_refused(command: str) -> None:
    with pytest.raises(UnsupportedFeature, match=command):
        parse_annotations(f"::{command}::x")


def test_harmless_commands_are_no_annotations() -> None:
    assert messages("::group::a\n::debug::b\n::endgroup::\n") == []


def test_outputs_are_lines_and_heredocs() -> None:
    text = "a=1=2\n\nb<<END\nx\n\ny=z\nEND\nc=x<<y\nd<<=\n1\n=\ne=\n"
    assert parse_outputs(text) == {"a": "1=2", "b": "x\n\ny=z", "c": "x<<y", "d": "1", "e": ""}


def test_a_heredoc_may_be_empty() -> None:
    assert parse_outputs("a<<E\nE") == {"a": ""}


@pytest.mark.parametrize("text", ["a", "=1", "<<E\nE", "a<<\n", "a<<END\nx\n"])
def test_outputs_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"neither|no closing"):
        parse_outputs(text)
