"""Find a file although the model spells its name differently: letter case, backslashes.

Windows and macOS find such a file, Linux does not.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Final

_MAX_NAMES: Final = 10_000


@dataclass(frozen=True, slots=True)
class Listings:
    """The names in folders, by their letters in lower case. Each folder is read once."""

    _names: dict[Path, dict[str, list[str]]] = field(default_factory=dict)

    def matched(self, folder: Path, path: str, may_read: Callable[[Path], bool]) -> Path | None:
        """Return the file at a path below a folder, in any letter case and with backslashes; None if there is none.

        Of several such names, the exact one is taken, else the first in the order of the alphabet.

        :param folder: without links.
        :param may_read: returns True if a folder without links in its path may be listed.
        """
        place = folder
        for part in PurePosixPath(path.replace("\\", "/")).parts:
            if part in ("/", ".."):
                place = Path("/") if part == "/" else place.parent
            elif not _may_list(place, may_read):
                return None
            else:
                names = self._in(place).get(part.casefold(), [])
                if not names:
                    return None
                place /= part if part in names else names[0]
        return place

    def similar(self, place: Path) -> list[str]:
        """Return the other names in the folder of a matched file that differ from its name in letter case only."""
        return [name for name in self._in(place.parent).get(place.name.casefold(), ()) if name != place.name]

    def _in(self, folder: Path) -> dict[str, list[str]]:
        if folder not in self._names:
            names = defaultdict[str, list[str]](list)
            try:
                with os.scandir(folder) as entries:
                    for name in sorted(entry.name for entry in islice(entries, _MAX_NAMES)):
                        names[name.casefold()].append(name)
            except (OSError, ValueError):  # no folder, no permission, or a NUL in its name
                pass
            self._names[folder] = dict(names)
        return self._names[folder]


def _may_list(place: Path, may_read: Callable[[Path], bool]) -> bool:
    try:
        return may_read(place.resolve())
    except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, or a loop of links
        return False
