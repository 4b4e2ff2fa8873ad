"""The 3D viewer of report.html, built from tools/viewer/: always the same bytes, from sources that name no registry."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

WEB = Path(__file__).parents[2] / "tools/viewer"
NODE = shutil.which("node", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    if NODE is None or not (WEB / "node_modules").exists():
        pytest.skip("`npm ci` has not been run in tools/viewer/, or there is no Node.js")
    return build(tmp_path_factory.mktemp("built") / "viewer3d.json")


def build(file: Path) -> bytes:
    subprocess.run([str(NODE), str(WEB / "build.mjs"), str(file)], check=True, capture_output=True)
    return file.read_bytes()


def test_two_builds_are_the_same_to_the_byte(built: bytes, tmp_path: Path) -> None:
    assert build(tmp_path / "viewer3d.json") == built


def test_it_is_small_and_has_its_fingerprint_and_its_licence_and_evaluates_no_text(built: bytes) -> None:
    stated = json.loads(built)
    script = gzip.decompress(base64.b64decode(stated["packed"]))
    assert stated["sha256"] == base64.b64encode(hashlib.sha256(script).digest()).decode()
    assert len(stated["packed"]) < 200_000
    assert b"The MIT License" in script[:2_000]
    assert b"new Function" not in script
    assert b"</script" not in script.lower()


def test_the_lock_file_names_no_address() -> None:
    lock = (WEB / "package-lock.json").read_text(encoding="utf-8")
    assert "http://" not in lock
    assert "https://" not in lock
    packages = json.loads(lock)["packages"]
    assert all("integrity" in package for name, package in packages.items() if name)
