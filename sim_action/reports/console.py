"""A stream that people read: a terminal, a file, or the log of GitHub, which obeys commands that stand in it."""

from __future__ import annotations

import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Where rich would end the process with a failure: who stops reading has not changed the verdict."""
        raise BrokenPipeError


@contextmanager
def console(stream: TextIO, environment: Mapping[str, str]) -> Iterator[Console]:
    """What prints on a stream; on GitHub, nothing that is printed meanwhile is a command."""
    on_github = environment.get("GITHUB_ACTIONS") == "true"
    with _no_workflow_commands(stream) if on_github else _as_it_is(stream):
        yield _console(stream, on_github=on_github, plain=bool(environment.get("NO_COLOR")))


def _console(stream: TextIO, *, on_github: bool, plain: bool) -> Console:
    # GitHub's log is no terminal, but shows colours.
    colourful = on_github and not plain
    return _Console(
        file=stream,
        force_terminal=True if colourful else None,
        color_system="standard" if colourful else "auto",
        no_color=plain or None,
        highlight=False,
        markup=False,
        emoji=False,
        legacy_windows=False,
    )


@contextmanager
def _no_workflow_commands(stream: TextIO) -> Iterator[None]:
    """GitHub obeys no command in what is printed meanwhile; nobody else knows the token that ends this."""
    token = secrets.token_hex(16)
    stream.write(f"::stop-commands::{token}\n")
    try:
        yield
    finally:
        stream.write(f"::{token}::\n")
        stream.flush()


@contextmanager
def _as_it_is(stream: TextIO) -> Iterator[None]:
    yield
    stream.flush()
