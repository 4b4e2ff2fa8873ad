"""What a step writes to the files that the runner gives it: GITHUB_OUTPUT, GITHUB_ENV and their like."""

from __future__ import annotations

from collections.abc import Iterator


def parse_outputs(text: str) -> dict[str, str]:
    """What a GITHUB_OUTPUT or GITHUB_ENV file says: `name=value` lines and heredocs. Raises ValueError."""
    outputs = {}
    lines = iter(text.removesuffix("\n").split("\n"))
    for line in lines:
        if line:
            name, value = _entry(line, lines)
            outputs[name] = value
    return outputs


def _entry(line: str, lines: Iterator[str]) -> tuple[str, str]:
    name, equals, value = line.partition("=")
    key, heredoc, delimiter = line.partition("<<")
    # Whichever sign comes first says what it is.
    if heredoc and len(key) < len(name) and key and delimiter:
        return key, "\n".join(_until(delimiter, lines))
    if equals and name and len(name) < len(key):
        return name, value
    raise ValueError(f"neither name=value nor name<<delimiter: {line!r}")


def _until(delimiter: str, lines: Iterator[str]) -> Iterator[str]:
    for line in lines:
        if line == delimiter:
            return
        yield line
    raise ValueError(f"no closing {delimiter!r}")
