"""Stand-ins for upload-artifact and download-artifact."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.stand_in import NO_OUTPUTS, StandIn, boolean, one_path
from tests.integration.github.stores import ArtifactStore
from tests.integration.github.values import to_text

_NO_ADDRESS: Final = {"artifact-id": "", "artifact-url": ""}


def _upload(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    store, folder = _store(machine), one_path(machine, inputs["path"])
    if not boolean(inputs["archive"]):
        return _upload_as_it_is(machine, store, folder)
    root = folder.parent if folder.is_file() else folder
    files = {str(file.relative_to(root)): file for file in (folder, *folder.rglob("*")) if _is_uploaded(file, root)}
    if files:
        store.upload(inputs["name"], files)
        return _address(machine, store)
    machine.record.complain(f"No files were found with the provided path: {inputs['path']}.", "warning")
    return _NO_ADDRESS


def _upload_as_it_is(machine: Machine, store: ArtifactStore, file: Path) -> Mapping[str, str]:
    """One file, whose name is that of the artifact, whatever the input says."""
    if not file.exists():
        machine.record.complain(f"No files were found with the provided path: {file}.", "warning")
        return _NO_ADDRESS
    if not file.is_file():
        raise UnsupportedFeature(f"the folder {file} without an archive")
    store.upload(file.name, {file.name: file})
    return _address(machine, store)


def _address(machine: Machine, store: ArtifactStore) -> Mapping[str, str]:
    """Of the artifact that was uploaded last, in a run and with a number that nobody else has."""
    number = str(len(store.names()))
    repository, run = (to_text(machine.github[name]) for name in ("repository", "run_id"))
    return {
        "artifact-id": number,
        "artifact-url": f"https://github.com/{repository}/actions/runs/{run}/artifacts/{number}",
    }


def _is_uploaded(file: Path, folder: Path) -> bool:
    return file.is_file() and not any(part.startswith(".") for part in file.relative_to(folder.parent).parts)


def _download(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    store, name, pattern = _store(machine), inputs["name"], inputs["pattern"]
    folder = one_path(machine, inputs["path"])
    if bool(name) == bool(pattern) or set(pattern) & set("![]?{}()"):
        raise UnsupportedFeature(f"a download of {name!r} and {pattern!r}")
    if name and name not in store.names():
        raise StepFailed(f"Unable to download artifact(s): Artifact not found for name: {name}")
    if name:
        store.download(name, folder)
    for match in fnmatch.filter(store.names(), pattern):
        store.download(match, folder / match)
    return NO_OUTPUTS


def _store(machine: Machine) -> ArtifactStore:
    if not machine.artifacts:
        raise UnsupportedFeature("artifacts outside a workflow run")
    return machine.artifacts


UPLOAD = StandIn(_upload, required=("path",), defaults={"name": "artifact", "archive": "true"})
DOWNLOAD = StandIn(_download, required=("path",), defaults={"name": "", "pattern": ""})
