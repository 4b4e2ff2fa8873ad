"""Read the text of a reference to a file: `package://name/path`, `model://name/path`, `file:///path`, or a path."""

from __future__ import annotations

import re
import sys
from pathlib import Path, PureWindowsPath
from typing import Final, NamedTuple

from sim_action.core.records import dataclass

_MAX_LENGTH: Final = 4_000
_MAX_FOLDERS: Final = 100
_MAX_SHOWN: Final = 60


@dataclass(frozen=True, slots=True)
class Note:
    """A note for the user; two notes of the same rule about the same folder say the same."""

    rule: str
    text: str
    about: Path


class Reference(NamedTuple):
    """The parts of a reference.

    Attributes:
        scheme: "package", "model", "file", or empty for a path.
        name: of the package or model; empty for other schemes.
        path: below the package or model; absolute or relative for other schemes.
    """

    scheme: str
    name: str
    path: str = ""

    @classmethod
    def parsed(cls, text: str) -> Reference:
        """Return the parts of a text. One slash or three after the scheme are accepted. Raises ValueError."""
        if len(text) > _MAX_LENGTH or len(re.findall(r"[\\/]+", text)) > _MAX_FOLDERS:
            limits = f"{_MAX_LENGTH:,} characters and {_MAX_FOLDERS} folders"
            raise ValueError(f"{text[:_MAX_SHOWN]!r}... is too long for a reference; at most {limits} are allowed")
        match = re.fullmatch(r"(package|model|file):([\\/]+)(.*)", text.strip(), re.DOTALL)
        if match is None:
            if "://" in text:
                allowed = (
                    "package://name/path, model://name/path, file:///path, or a path relative to the referring file"
                )
                raise ValueError(f"'{text}' is not a valid reference; allowed are {allowed}")
            return cls("", "", text.strip())
        scheme, slashes, rest = match.groups()
        if scheme == "file":
            return cls(scheme, "", _path_of_address(rest if slashes == "//" else f"/{rest}"))
        name, _, path = rest.replace("\\", "/").partition("/")
        path = path.lstrip("/")
        if not name or not path:
            raise ValueError(f"'{text}' names no file; write {scheme}://name/path/of/the/file")
        return cls(scheme, name, path)

    @property
    def is_absolute(self) -> bool:
        """Return True for the absolute path of an address such as file:///robot.stl."""
        has_drive = sys.platform == "win32" and PureWindowsPath(self.path).drive
        return self.scheme == "file" and bool(self.path.startswith("/") or has_drive)

    def odd_start(self, text: str) -> str:
        """Return the start of the text of this reference, with the name, if it is not as in package://name/."""
        text = text.strip()
        is_usual = not self.name or text.startswith(f"{self.scheme}://{self.name}/")
        return "" if is_usual else f"{text.partition(self.name)[0]}{self.name}"


def _path_of_address(rest: str) -> str:
    path = rest.removeprefix("localhost")
    # The path of file:///C:/robot.stl starts with a slash, too.
    is_on_drive = sys.platform == "win32" and PureWindowsPath(path[1:]).drive
    return path[1:] if is_on_drive else path
