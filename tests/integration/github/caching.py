"""Stand-ins for the two halves of actions/cache."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.stand_in import NO_OUTPUTS, StandIn, one_path

_LONGEST_KEY = 512


def _restore(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    key, prefix, path = _key(inputs["key"]), _key(inputs["restore-keys"]), one_path(machine, inputs["path"])
    if machine.cache is None:
        machine.record.hear("[warning]Cache service is not available\n")
    elif (found := machine.cache.matching(key, prefix, _everywhere(machine, path))) is None:
        machine.record.hear(f"Cache not found for input keys: {key}\n")
    else:
        machine.cache.restore(found, _everywhere(machine, path), path)
        machine.record.hear(f"Cache restored from key: {found}\n")
        return {"cache-matched-key": found}
    return {"cache-matched-key": ""}


def _save(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    """Whatever is wrong, it never fails the step."""
    key, path = _key(inputs["key"]), one_path(machine, inputs["path"])
    if machine.cache is None:
        machine.record.hear("[warning]Cache service is not available\n")
    elif not path.exists() or not machine.cache.save(key, _everywhere(machine, path), path):
        machine.record.complain("Cache save failed.", "warning")
    else:
        machine.record.hear(f"Cache saved with key: {key}\n")
    return NO_OUTPUTS


def _key(key: str) -> str:
    if len(key) > _LONGEST_KEY or "," in key or "\n" in key:
        raise UnsupportedFeature(f"the key {key!r}, which is not valid or more than one")
    return key


def _everywhere(machine: Machine, path: Path) -> str:
    """How a path is known in all jobs, whose folders here are not the same."""
    for name, folder in (("home", machine.home), ("temp", machine.temp), ("workspace", machine.workspace)):
        if path.is_relative_to(folder):
            return f"{name}:{path.relative_to(folder)}"
    return str(path)


RESTORE = StandIn(_restore, required=("path", "key"), defaults={"restore-keys": ""})
SAVE = StandIn(_save, required=("path", "key"))
