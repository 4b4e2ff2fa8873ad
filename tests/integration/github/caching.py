"""Stand-ins for actions/cache and its two halves."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from tests.integration.github.errors import StepFailed
from tests.integration.github.globs import lines
from tests.integration.github.machine import Machine
from tests.integration.github.stand_in import StandIn, boolean

_LONGEST_KEY = 512


def _restore(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    key, prefixes, paths = inputs["key"], lines(inputs["restore-keys"]), _paths(machine, inputs["path"])
    if machine.cache is None:
        machine.record.hear("[warning]Cache service is not available\n")
        return {"cache-primary-key": key, "cache-hit": "false"}
    if invalid := next((key for key in (key, *prefixes) if not _is_valid(key)), None):
        raise StepFailed(f"Key Validation Error: {invalid} cannot be larger than 512 characters or contain commas.")
    found = machine.cache.matching(key, prefixes, list(paths))
    if found is None:
        return _not_found(machine, key, fail=boolean(inputs["fail-on-cache-miss"]))
    if not boolean(inputs["lookup-only"]):
        machine.cache.restore(found, paths)
    machine.record.hear(f"Cache restored from key: {found}\n")
    return {"cache-primary-key": key, "cache-hit": str(found == key).lower(), "cache-matched-key": found}


def _not_found(machine: Machine, key: str, *, fail: bool) -> Mapping[str, str]:
    if fail:
        raise StepFailed(f"Failed to restore cache entry. Exiting as fail-on-cache-miss is set. Input key: {key}")
    machine.record.hear(f"Cache not found for input keys: {key}\n")
    return {"cache-primary-key": key}


def _save(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    """Whatever is wrong, it never fails the step."""
    key, paths = inputs["key"], _paths(machine, inputs["path"])
    if machine.cache is None:
        machine.record.hear("[warning]Cache service is not available\n")
    elif not _is_valid(key) or not any(path.exists() for path in paths.values()):
        machine.record.hear("[warning]The key is not valid, or the paths that are to be cached do not exist\n")
        machine.record.complain("Cache save failed.", "warning")
    elif not machine.cache.save(key, paths):
        machine.record.hear(f"Failed to save: Unable to reserve cache with key {key}\n")
        machine.record.complain("Cache save failed.", "warning")
    else:
        machine.record.hear(f"Cache saved with key: {key}\n")
    return {}


def _restore_now_and_save_later(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    outputs = _restore(machine, inputs)
    if outputs.get("cache-hit") != "true":
        machine.afterwards.append(partial(_save, machine, inputs))
    return outputs


def _is_valid(key: str) -> bool:
    return len(key) <= _LONGEST_KEY and "," not in key


def _paths(machine: Machine, text: str) -> dict[str, Path]:
    """Paths by how they are known in all jobs, whose folders here are not the same."""
    paths = [machine.workspace / line for line in lines(text)]
    return {_everywhere(machine, path): path for path in paths}


def _everywhere(machine: Machine, path: Path) -> str:
    for name, folder in (("temp", machine.temp), ("workspace", machine.workspace)):
        if path.is_relative_to(folder):
            return f"{name}:{path.relative_to(folder)}"
    return str(path)


_OPTIONS = {"restore-keys": "", "fail-on-cache-miss": "false", "lookup-only": "false"}
RESTORE = StandIn(_restore, required=("path", "key"), defaults=_OPTIONS)
SAVE = StandIn(_save, required=("path", "key"))
CACHE = StandIn(_restore_now_and_save_later, required=("path", "key"), defaults=_OPTIONS)
