"""Stand-ins for upload-artifact and download-artifact."""

from __future__ import annotations

import fnmatch
import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.globs import Found, find, lines
from tests.integration.github.machine import Machine
from tests.integration.github.stand_in import StandIn, boolean
from tests.integration.github.stores import ArtifactStore


def _upload(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    store, name = _store(machine), inputs["name"]
    if not inputs["retention-days"].isdecimal() or int(inputs["retention-days"]) > 90:
        raise StepFailed(f"Invalid retention-days: {inputs['retention-days']}")
    found = find(lines(inputs["path"]), machine.workspace, descend=True)
    hidden = boolean(inputs["include-hidden-files"])
    files = {path: file for path, file in _paths(found).items() if hidden or not _is_hidden(file, found.roots)}
    if not files:
        return _nothing_found(machine, inputs)
    store.upload(name, files, overwrite=boolean(inputs["overwrite"]))
    number = str(store.names().index(name) + 1)
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files.values())).hexdigest()
    url = f"https://github.com/{machine.github['repository']}/actions/runs/1/artifacts/{number}"
    machine.record.hear(f"Artifact {name} has {len(files)} files\n")
    return {"artifact-id": number, "artifact-digest": digest, "artifact-url": url}


def _nothing_found(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    message = f"No files were found with the provided path: {inputs['path']}. No artifacts will be uploaded."
    match inputs["if-no-files-found"]:
        case "warn":
            machine.record.complain(message, "warning")
        case "error":
            raise StepFailed(message)
        case "ignore":
            pass
        case other:
            raise StepFailed(f"Unrecognized if-no-files-found input: {other}")
    return {}


def _paths(found: Found) -> dict[str, Path]:
    """Files by their path in the artifact: below what all patterns have in common."""
    if not found.files:
        return {}
    root = Path(os.path.commonpath(found.roots))
    # A file that is named itself has no folder in the artifact.
    root = root.parent if found.files == (root,) else root
    return {str(file.relative_to(root)): file for file in found.files}


def _is_hidden(file: Path, roots: Sequence[Path]) -> bool:
    root = next(root for root in roots if file.is_relative_to(root))
    return any(part.startswith(".") for part in file.relative_to(root.parent).parts)


def _download(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    store = _store(machine)
    folder = machine.workspace / inputs["path"]
    one = inputs["name"]
    if one and one not in store.names():
        raise StepFailed(f"Unable to download artifact(s): Artifact not found for name: {one}")
    names = [one] if one else _matching(store, inputs["pattern"])
    together = bool(one) or boolean(inputs["merge-multiple"])
    for name in names:
        store.download(name, folder if together else folder / name)
    machine.record.hear(f"Total of {len(names)} artifact(s) downloaded\n")
    return {"download-path": str(folder)}


def _matching(store: ArtifactStore, pattern: str) -> list[str]:
    if pattern.startswith("!") or set(pattern) & set("{}()"):
        raise UnsupportedFeature(f"pattern: {pattern}")
    return [name for name in store.names() if not pattern or fnmatch.fnmatchcase(name, pattern)]


def _store(machine: Machine) -> ArtifactStore:
    if not machine.artifacts:
        raise UnsupportedFeature("artifacts outside a workflow run")
    return machine.artifacts


UPLOAD = StandIn(
    _upload,
    required=("path",),
    defaults={
        "name": "artifact",
        "if-no-files-found": "warn",
        "retention-days": "0",
        "compression-level": "6",
        "overwrite": "false",
        "include-hidden-files": "false",
    },
)
DOWNLOAD = StandIn(_download, defaults={"name": "", "path": "", "pattern": "", "merge-multiple": "false"})
