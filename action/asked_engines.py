"""The engines that the scenarios of a job ask for, guessed from the text of files: no YAML reader is installed yet.

A wrong guess costs time, and never a verdict: an engine that was left out is installed when it is first imported.
"""

from __future__ import annotations

import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from action.lock import ENGINES

BOTH: Final = frozenset(ENGINES)
_DEFAULT: Final = frozenset({"pybullet"})
_MAX_ENTRIES: Final = 20_000
_MAX_BYTES: Final = 1_000_000
_MAX_TOTAL_BYTES: Final = 100_000_000
_SCENARIO: Final = (".sim.yml", ".sim.yaml")
_WITHOUT_SCENARIOS: Final = frozenset({".git", ".github", "node_modules"})
_READ: Final = (".yml", ".yaml", "pyproject.toml")
# A name of the engine, a robot that only it can read, a comparison of engines, or text with escapes.
_ASKS_MUJOCO: Final = re.compile(
    rb"mujoco|\bagreement\b|(?<!\.launch)(?<!\bpackage)\.xml\b|\.mjcf\b|\bbackend\W+all\b|\\[xu\n\r]"
)
# A part of scenarios, such as a base that they extend: it has such a key at its top, after a mark of YAML or none.
_PART: Final = re.compile(rb"^(?:[^\w\s#]{1,4} ?)?(?:backend|robot|agreement|variations|extends)\b", re.MULTILINE)
_ONLY_MUJOCO: Final = re.compile(rb"^backend[ \t]*:[ \t]*[\"']?mujoco\b", re.MULTILINE)


def asked_engines(variables: Mapping[str, str]) -> frozenset[str]:
    """Return the engines to install. `variables`: the environment, with the inputs of the action as `INPUT_...`."""
    backend = (variables.get("INPUT_BACKEND", "").strip() or variables.get("SIM_ACTION_BACKEND", "")).strip().lower()
    if backend in BOTH:
        return frozenset({backend})
    if backend not in {"", "auto"}:
        return BOTH
    try:
        return _asked_by(_texts(Path(variables.get("INPUT_WORKING_DIRECTORY", "").strip() or ".")))
    except (_TooMuch, OSError, ValueError, AttributeError, RuntimeError):  # the last: deep folders, loops of links
        return BOTH


class _TooMuch(Exception):
    """More files, or longer ones, than are searched."""


def _asked_by(texts: Iterator[tuple[str, bytes]]) -> frozenset[str]:
    asked = False
    scenarios = only_mujoco = 0
    for name, text in texts:
        is_scenario = name.endswith(_SCENARIO)
        is_project = name == "pyproject.toml"
        decides = is_scenario or is_project or _PART.search(text)
        asked = asked or bool(decides and _ASKS_MUJOCO.search(_settings(text) if is_project else text))
        if is_scenario:
            scenarios += 1
            only_mujoco += bool(_ONLY_MUJOCO.search(text))
        if asked and only_mujoco < scenarios:
            return BOTH
    if not asked:
        return _DEFAULT
    return frozenset({"mujoco"}) if scenarios else BOTH


def _settings(text: bytes) -> bytes:
    """Return the engine that a pyproject.toml names. Raises ValueError: it is no TOML."""
    table = tomllib.loads(text.decode()).get("tool", {}).get("sim-action", {})
    return json.dumps({"backend": table.get("backend")}).encode()


def _texts(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and text of each YAML file below a folder, and of pyproject.toml there and in the folders above.

    The text is in lower case, without the zero bytes of UTF-16. Raises _TooMuch, OSError, RuntimeError.
    """
    folder = folder.resolve(strict=True)
    for above in folder.parents:
        if os.path.lexists(above / "pyproject.toml"):
            yield "pyproject.toml", _text(above / "pyproject.toml", above)
    seen = total = 0
    for parent, folders, files in os.walk(folder, onerror=_refuse):
        folders[:] = [name for name in folders if name not in _WITHOUT_SCENARIOS]
        seen += len(folders) + len(files)
        if seen > _MAX_ENTRIES:
            raise _TooMuch
        for name in files:
            if name.endswith(_READ):
                text = _text(Path(parent, name), folder)
                total += len(text)
                if total > _MAX_TOTAL_BYTES:
                    raise _TooMuch
                yield name, text


def _text(file: Path, folder: Path) -> bytes:
    """Return the text of a regular file that lies in a folder, with links resolved.

    Raises _TooMuch, OSError, RuntimeError. A device or a pipe, to which a link can lead, may never end.
    """
    place = file.resolve(strict=True)
    if not place.is_relative_to(folder):
        raise OSError("the file lies outside")
    flags = (getattr(os, name, 0) for name in ("O_BINARY", "O_NONBLOCK", "O_NOFOLLOW", "O_NOCTTY"))
    with os.fdopen(os.open(place, os.O_RDONLY | sum(flags)), "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError("the file is not a regular one")
        text = stream.read(_MAX_BYTES + 1)
    if len(text) > _MAX_BYTES:
        raise _TooMuch
    return text.replace(b"\0", b"").lower()


def _refuse(error: OSError) -> None:
    raise error
