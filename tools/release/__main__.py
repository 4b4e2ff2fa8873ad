"""Check that everything agrees on the version, write the text of a release, and prepare the next one.

Usage, with the standard library only:

    python -m tools.release check [--tag v1.2.3]    print each disagreement as `path:line: message`; exit with 1 if any
    python -m tools.release notes 1.2.3             print the text of the release, from CHANGELOG.md
    python -m tools.release cut 1.2.3 [--date DAY]  write the version everywhere, and move "Unreleased" below it

The steps around it are in docs/contributing/releasing.md.
"""

from __future__ import annotations

import argparse
import datetime as dt
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
CHANGELOG: Final = "CHANGELOG.md"
REPOSITORY: Final = "sim-action/sim-action"
MAX_NOTES_LENGTH: Final = 125_000
"""The number of characters that GitHub allows for the text of a release."""

_PACKAGE: Final = "sim_action/core/version.py"
_UNRELEASED: Final = "Unreleased"
# The order in a released section. "Unreleased" may have any order, and a name several times.
_PARTS: Final = ("Added", "Changed", "Deprecated", "Removed", "Fixed", "Security")

_SUFFIXES: Final = frozenset({".md", ".yml", ".yaml", ".py", ".toml"})
# Tests name versions that do not exist; the others are not in the repository.
_OTHER_FOLDERS: Final = frozenset({"tests", "node_modules", "_site", "dist", "build", "sim-results", "__pycache__"})
_HIDDEN_FOLDERS: Final = frozenset({".github"})

_ASSIGNMENT: Final = re.compile(r'^__version__ = "(?P<found>[^"\n]*)"', re.MULTILINE)
# The places that name the tag that moves, and the places that name one release.
_MOVING: Final = (
    re.compile(r"sim-action/sim-action(?:/[\w-]+)?@(?P<found>v\d[\w.]*)"),
    re.compile(r"`@?(?P<found>v\d+)`"),
)
_EXACT: Final = (
    re.compile(r"sim-action/sim-action(?:/[\w-]+)?@<commit> # (?P<found>v[\w.]+)"),
    re.compile(r"sim-action/sim-action(?:\.git)?\n\s+rev: (?P<found>\S+)"),
)
_IMAGE: Final = re.compile(r"ghcr\.io/sim-action/sim-action:(?P<found>\d[\w.]*)")
# The places that name the version by its numbers; the last two are in the plugin of pytest.
_NUMBERS: Final = (
    re.compile(r"\bsim-action==(?P<found>\d[\w.]*)"),
    re.compile(r'^name = "pytest-sim-action"\nversion = "(?P<found>[^"\n]*)"', re.MULTILINE),
    re.compile(r'"sim-action>=(?P<found>\d[\w.]*)"'),
)

_HEADING: Final = re.compile(r"^## (?P<name>\S+)(?: \((?P<day>[\d-]+)\))?$", re.MULTILINE)
_RELATIVE_LINK: Final = re.compile(r"\]\((?!\w+:|#)([^)\s]+)\)")
_PART_HEADING: Final = re.compile(r"^### (?P<name>.+)$", re.MULTILINE)


class ReleaseError(Exception):
    """A release that cannot be prepared; the message says why."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A line that disagrees with the version of the package."""

    path: str
    line: int
    message: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.message}"


@dataclass(frozen=True, slots=True)
class Section:
    """A section of CHANGELOG.md: its name (a version or "Unreleased"), the line of its heading, and its text."""

    name: str
    line: int
    text: str


def moving_tag(version: str) -> str:
    """Return the tag that moves to the newest release of this major version, such as v0."""
    return f"v{version.partition('.')[0]}"


def read_version(root: Path = ROOT) -> str:
    """Return the version in the package. Raise ReleaseError if there is none of the form 1.2.3."""
    assignment = _ASSIGNMENT.search((root / _PACKAGE).read_text(encoding="utf-8"))
    if assignment is None:
        raise ReleaseError('there is no line such as __version__ = "1.2.3"')
    _numbers(assignment["found"])
    return assignment["found"]


def sections(changelog: str) -> list[Section]:
    """Return the sections of a changelog, in its order."""
    return [Section(name["name"], _line(changelog, name.start()), text) for name, text in _divided(_HEADING, changelog)]


def notes(changelog: str, version: str) -> str:
    """Return the text of a release: the section of the changelog, with links that work on the page of the release.

    Raise ReleaseError if there is no such section, or if it is too long.
    """
    section = next((part for part in sections(changelog) if part.name == version), None)
    if section is None or not section.text:
        raise ReleaseError(f"{CHANGELOG} has no text for {version}; run: python -m tools.release cut {version}")
    if len(section.text) > MAX_NOTES_LENGTH:
        length = f"{len(section.text):,} characters; GitHub allows {MAX_NOTES_LENGTH:,}"
        raise ReleaseError(f"{CHANGELOG}:{section.line}: the text of {version} has {length}")
    return _RELATIVE_LINK.sub(rf"](https://github.com/{REPOSITORY}/blob/v{version}/\1)", section.text) + "\n"


def problems(root: Path = ROOT, tag: str | None = None) -> Iterator[Problem]:
    """Yield each line that disagrees with `__version__`; with a tag, also each reason against its release."""
    try:
        version = read_version(root)
    except ReleaseError as error:
        yield Problem(_PACKAGE, 1, str(error))
        return
    if tag is not None and tag != f"v{version}":
        text = (root / _PACKAGE).read_text(encoding="utf-8")
        line = _line(text, next(_ASSIGNMENT.finditer(text)).start())
        yield Problem(_PACKAGE, line, f'__version__ is "{version}", but the tag is {tag}')
    yield from _changelog_problems((root / CHANGELOG).read_text(encoding="utf-8"), version, released=tag is not None)
    for path in _documents(root):
        yield from _document_problems(path.relative_to(root).as_posix(), _checked_text(path), version)


def cut(root: Path, version: str, day: str) -> list[str]:
    """Write the version everywhere, and move "Unreleased" below it; return the changed paths. Raise ReleaseError."""
    _numbers(version)
    path = root / CHANGELOG
    changelog = path.read_text(encoding="utf-8")
    texts = {path: _cut_changelog(changelog, version, day)}
    package = root / _PACKAGE
    texts[package] = _replaced(_ASSIGNMENT, package.read_text(encoding="utf-8"), version)
    for document in _documents(root):
        before = texts.get(document, document.read_text(encoding="utf-8"))
        checked = before[: len(before) - len(_unchecked_end(document, before))]
        texts[document] = _with_version(checked, version) + before[len(checked) :]
    changed = {path: text for path, text in texts.items() if text != path.read_text(encoding="utf-8")}
    for path, text in changed.items():
        path.write_text(text, encoding="utf-8")
    return sorted(path.relative_to(root).as_posix() for path in changed)


def _numbers(version: str) -> tuple[int, ...]:
    if not re.fullmatch(r"(?:0|[1-9]\d*)(?:\.(?:0|[1-9]\d*)){2}", version):
        raise ReleaseError(f'"{version}" is not a version; write three numbers, such as 1.2.3')
    return tuple(int(number) for number in version.split("."))


def _changelog_problems(changelog: str, version: str, *, released: bool) -> Iterator[Problem]:
    listed = sections(changelog)
    newest = next((section for section in listed if section.name != _UNRELEASED), None)
    remedy = f"run: python -m tools.release cut {version}"
    if newest is not None and newest.name != version:
        yield Problem(CHANGELOG, newest.line, f'the newest version is {newest.name}, but __version__ is "{version}"')
    if newest is None and released:
        yield Problem(CHANGELOG, 1, f"there is no section for {version}; {remedy}")
    if newest is None and not listed:
        yield Problem(CHANGELOG, 1, f'there is neither a section "{_UNRELEASED}" nor one for {version}')
    for section in listed:
        if section.name == _UNRELEASED and section.text and released:
            yield Problem(CHANGELOG, section.line, f'"{_UNRELEASED}" is not empty; {remedy}')
    for part in _PART_HEADING.finditer(changelog):
        if part["name"] not in _PARTS:
            message = f'the heading "{part["name"]}" is not one of {", ".join(_PARTS)}'
            yield Problem(CHANGELOG, _line(changelog, part.start()), message)
    if released and newest is not None and newest.name == version:
        try:
            notes(changelog, version)
        except ReleaseError as error:
            yield Problem(CHANGELOG, newest.line, str(error))


def _document_problems(path: str, text: str, version: str) -> Iterator[Problem]:
    for patterns, expected in _rules(version):
        for pattern in patterns:
            for match in pattern.finditer(text):
                if match["found"] != expected:
                    message = f'{match["found"]} must be {expected}, because __version__ is "{version}"'
                    yield Problem(path, _line(text, match.start("found")), message)


def _rules(version: str) -> list[tuple[tuple[re.Pattern[str], ...], str]]:
    return [
        (_MOVING, moving_tag(version)),
        (_EXACT, f"v{version}"),
        (_NUMBERS, version),
        ((_IMAGE,), version.partition(".")[0]),
    ]


def _with_version(text: str, version: str) -> str:
    for patterns, expected in _rules(version):
        for pattern in patterns:
            text = _replaced(pattern, text, expected)
    return text


def _replaced(pattern: re.Pattern[str], text: str, expected: str) -> str:
    def replaced(match: re.Match[str]) -> str:
        start, end = match.span("found")
        return match[0][: start - match.start()] + expected + match[0][end - match.start() :]

    return pattern.sub(replaced, text)


def _documents(root: Path) -> Iterator[Path]:
    """Yield the files that can name a version, without tests and other projects."""
    for folder, names, files in os.walk(root):
        names[:] = sorted(
            name
            for name in names
            if name not in _OTHER_FOLDERS and (not name.startswith(".") or name in _HIDDEN_FOLDERS)
        )
        for name in sorted(files):
            if name == "Dockerfile" or Path(name).suffix in _SUFFIXES:
                yield Path(folder, name)


def _checked_text(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    return text[: len(text) - len(_unchecked_end(path, text))]


def _unchecked_end(path: Path, text: str) -> str:
    """Return the part of a file that may name other versions: the sections of the changelog."""
    first = _HEADING.search(text) if path.name == CHANGELOG else None
    return text[first.start() :] if first else ""


def _cut_changelog(changelog: str, version: str, day: str) -> str:
    listed = sections(changelog)
    unreleased = next((section for section in listed if section.name == _UNRELEASED), None)
    if unreleased is None or not unreleased.text:
        raise ReleaseError(f'{CHANGELOG} has nothing under "## {_UNRELEASED}"')
    for section in listed:
        if section.name != _UNRELEASED and _numbers(section.name) >= _numbers(version):
            raise ReleaseError(f"{CHANGELOG}:{section.line}: {section.name} is not older than {version}")
    heading = next(match for match in _HEADING.finditer(changelog) if match["name"] == _UNRELEASED)
    after = next((later.start() for later in _HEADING.finditer(changelog) if later.start() > heading.end()), None)
    rest = changelog[after:] if after is not None else ""
    cut_section = f"## {version} ({day})\n\n{_ordered(unreleased.text)}\n"
    return changelog[: heading.start()] + f"## {_UNRELEASED}\n\n" + cut_section + (f"\n{rest}" if rest else "")


def _ordered(text: str) -> str:
    """Return a section with its parts in one order, and parts of the same name joined."""
    first = _PART_HEADING.search(text)
    overview = text[: first.start()].strip() if first else text
    parts: dict[str, list[str]] = {name: [] for name in _PARTS}
    for heading, part in _divided(_PART_HEADING, text):
        if heading["name"] not in parts:
            raise ReleaseError(f'the heading "{heading["name"]}" is not one of {", ".join(_PARTS)}')
        parts[heading["name"]].append(part)
    joined = [f"### {name}\n\n" + "\n\n".join(filter(None, texts)) for name, texts in parts.items() if any(texts)]
    return "\n\n".join(filter(None, [overview, *joined]))


def _divided(headings: re.Pattern[str], text: str) -> list[tuple[re.Match[str], str]]:
    """Return each heading of a text with the lines up to the next one."""
    matches = list(headings.finditer(text))
    ends = [heading.start() for heading in matches[1:]] + [len(text)]
    return [(heading, text[heading.end() : end].strip()) for heading, end in zip(matches, ends, strict=False)]


def _line(text: str, position: int) -> int:
    return text.count("\n", 0, position) + 1


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    """Run a subcommand and return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.release", description="Check and prepare releases.")
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser("check", help="print each line that disagrees with the version")
    check.add_argument("--tag", help="the tag that is about to be released, such as v1.2.3")
    for name, text in (("notes", "print the text of a release"), ("cut", "write the version everywhere")):
        commands.add_parser(name, help=text).add_argument("version")
    today = dt.datetime.now(tz=dt.UTC).date().isoformat()
    commands.choices["cut"].add_argument("--date", default=today, help="day of the release (default: today)")
    options = parser.parse_args(arguments)
    try:
        return _run(options, root)
    except ReleaseError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1


def _run(options: argparse.Namespace, root: Path) -> int:
    if options.command == "notes":
        print(notes((root / CHANGELOG).read_text(encoding="utf-8"), options.version), end="")
        return 0
    if options.command == "cut":
        for path in cut(root, options.version, options.date):
            print(f"wrote {path}")
        return 0
    disagreements = list(problems(root, options.tag))
    for problem in disagreements:
        print(problem)
    if not disagreements:
        print(f"release: everything agrees on version {read_version(root)}")
    return 1 if disagreements else 0


if __name__ == "__main__":
    sys.exit(main())
