"""Small lock files with wheels that fit them."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from action.lock import Entry, entries

MakeWheel = Callable[..., Entry]


def wheel_bytes(files: Mapping[str, str | bytes], executable: tuple[str, ...] = ()) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            info = zipfile.ZipInfo(name)
            info.external_attr = (0o755 if name in executable else 0o644) << 16
            archive.writestr(info, text)
    return buffer.getvalue()


def entry_of(name: str, version: str, *contents: bytes) -> Entry:
    hashes = "".join(f" \\\n    --hash=sha256:{hashlib.sha256(content).hexdigest()}" for content in contents)
    [entry] = entries(f"{name}=={version}{hashes}\n")
    return entry


@pytest.fixture
def make_wheel(tmp_path: Path) -> MakeWheel:
    """Writes a wheel into the folder `wheels`, and returns its entry of a lock file."""

    def make(
        name: str, version: str = "1.0", files: Mapping[str, str | bytes] | None = None, folder: str = "wheels"
    ) -> Entry:
        spelled = name.replace("-", "_")
        metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        content = wheel_bytes(
            {f"{spelled}-{version}.dist-info/METADATA": metadata, **(files or {f"{spelled}/__init__.py": ""})}
        )
        path = tmp_path / folder / f"{spelled}-{version}-py3-none-any.whl"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        return entry_of(name, version, content)

    return make
