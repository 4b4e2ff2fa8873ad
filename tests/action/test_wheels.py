from __future__ import annotations

import io
import os
import struct
import sys
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from action.wheels import Target, WheelError, are_there, install, unpack
from tests.action.conftest import MakeWheel, wheel_bytes


def target(folder: Path) -> Target:
    site = folder / "site-packages"
    folders = {"purelib": site, "platlib": site, "scripts": folder / "bin", "data": folder}
    return Target(folder / "bin/python", folders)


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_wheel_is_unpacked_with_its_metadata(tmp_path: Path, make_wheel: MakeWheel) -> None:
    entry = make_wheel("some-thing", files={"some_thing/deep/a.py": "A = 1\n", "top.py": ""})
    size = install([entry], tmp_path / "wheels", target(tmp_path / "env"))
    assert size == sum(wheel.stat().st_size for wheel in (tmp_path / "wheels").iterdir())
    assert files(tmp_path / "env/site-packages") == {
        "some_thing/deep/a.py",
        "top.py",
        "some_thing-1.0.dist-info/METADATA",
    }


def test_folders_of_data_go_to_their_places(tmp_path: Path) -> None:
    content = wheel_bytes(
        {
            "a-1.data/purelib/a.py": "",
            "a-1.data/platlib/b.so": "",
            "a-1.data/data/share/c.txt": "",
            "a-1.data/headers/d.h": "",
            "a-1.data/scripts/tool": "#!python\nprint(1)\n",
            "a-1.data/scripts/windowed": "#!pythonw\r\n",
            "a-1.data/scripts/shell": "#!/bin/sh\n",
        }
    )
    unpack(content, target(tmp_path))
    assert files(tmp_path) == {
        "site-packages/a.py",
        "site-packages/b.so",
        "share/c.txt",
        "bin/tool",
        "bin/windowed",
        "bin/shell",
    }
    python = tmp_path / "bin/python"
    assert (tmp_path / "bin/tool").read_text() == f"#!{python}\nprint(1)\n"
    assert (tmp_path / "bin/windowed").read_bytes() == f"#!{python}\r\n".encode()
    assert (tmp_path / "bin/shell").read_text() == "#!/bin/sh\n"
    assert os.access(tmp_path / "bin/tool", os.X_OK)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such bits")
def test_programs_in_packages_stay_executable(tmp_path: Path) -> None:
    unpack(wheel_bytes({"a/run": "", "a/text": ""}, executable=("a/run",)), target(tmp_path))
    modes = {path.name: path.stat().st_mode & 0o111 for path in (tmp_path / "site-packages/a").iterdir()}
    assert modes["run"]
    assert not modes["text"]


@pytest.mark.parametrize(
    "name",
    [
        "../evil.py",
        "a/../../evil.py",
        "/etc/evil",
        "a\\..\\..\\evil.py",
        "C:/evil.py",
        "a/b:stream",
        "a-1.data/data/../../../evil",
        "a-1.data/evil",
        "a-1.data",
    ],
)
def test_paths_that_lead_out_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(WheelError, match="a file with the path"):
        unpack(wheel_bytes({name: "x"}), target(tmp_path / "env"))
    assert not files(tmp_path)


@given(st.lists(st.sampled_from(["..", ".", "", "a", "a.data", "data", "purelib", "\\", "C:", "~"]), min_size=1))
def test_no_path_leads_out_of_the_environment(tmp_path_factory: pytest.TempPathFactory, parts: list[str]) -> None:
    folder = tmp_path_factory.mktemp("slip")
    with suppress(WheelError, OSError):
        unpack(wheel_bytes({"/".join(parts): "x"}), target(folder / "env"))
    assert {path.name for path in folder.iterdir()} <= {"env"}


@pytest.mark.parametrize("cut", [0, 10, -30])
def test_a_damaged_wheel_is_refused(cut: int, tmp_path: Path) -> None:
    content = wheel_bytes({"a.py": "x" * 1000})
    with pytest.raises(WheelError):
        unpack(content[:cut], target(tmp_path))


def test_damaged_and_encrypted_wheels(tmp_path: Path) -> None:
    # Damaged content is refused.
    content = bytearray(wheel_bytes({"a.py": "xyz" * 1000}))
    content[40] ^= 255
    with pytest.raises(WheelError):
        unpack(bytes(content), target(tmp_path))
    # An encrypted wheel is refused.
    content = bytearray(wheel_bytes({"a.py": "x"}))
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(signature) + offset] |= 1
    assert zipfile.is_zipfile(io.BytesIO(bytes(content)))
    with pytest.raises(WheelError):
        unpack(bytes(content), target(tmp_path))


def test_a_wheel_with_another_hash_is_refused_before_it_is_unpacked(tmp_path: Path, make_wheel: MakeWheel) -> None:
    entry = make_wheel("a")
    make_wheel("a", files={"a/__init__.py": "raise SystemExit('other')"})
    with pytest.raises(WheelError, match=r"a-1\.0-py3-none-any\.whl does not have a hash of the lock file"):
        install([entry], tmp_path / "wheels", target(tmp_path / "env"))
    assert not (tmp_path / "env").exists()


def test_each_package_needs_exactly_one_wheel(tmp_path: Path, make_wheel: MakeWheel) -> None:
    first, second = make_wheel("a"), make_wheel("b")
    assert are_there([first, second], tmp_path / "wheels")
    (tmp_path / "wheels/a-1.0-cp311-none-any.whl").write_bytes(b"")
    with pytest.raises(WheelError, match=r"2 wheels of a 1\.0"):
        install([first, second], tmp_path / "wheels", target(tmp_path / "env"))
    (tmp_path / "wheels/b-1.0-py3-none-any.whl").unlink()
    assert not are_there([first, second], tmp_path / "wheels")
    with pytest.raises(WheelError, match=r"0 wheels of b 1\.0"):
        install([second], tmp_path / "wheels", target(tmp_path / "env"))


def test_wheels_of_other_packages_and_parts_are_left_out(tmp_path: Path, make_wheel: MakeWheel) -> None:
    # Wheels that are not in the lock file are not read.
    entry = make_wheel("a")
    (tmp_path / "wheels/evil-1.0-py3-none-any.whl").write_bytes(b"no zip file")
    install([entry], tmp_path / "wheels", target(tmp_path / "env"))
    assert "a/__init__.py" in files(tmp_path / "env/site-packages")
    # Models and the renderer of pybullet are left out.
    names = ("pybullet.so", "pybullet_data/a.urdf", "pybullet_envs/a.py", "eglRenderer.so", "pybullet_utils/a.py")
    entry = make_wheel("pybullet", files=dict.fromkeys(names, ""))
    install([entry], tmp_path / "wheels", target(tmp_path / "other"))
    found = files(tmp_path / "other/site-packages")
    assert found == {"pybullet.so", "pybullet_utils/a.py", "pybullet-1.0.dist-info/METADATA"}


def library(segments: list[tuple[int, int]], rest: bytes) -> bytes:
    """An ELF file with a table of sections in its `rest`; `segments`: offset and size of each."""
    end = max((offset + size for offset, size in segments), default=64)
    header = b"\x7fELF\x02\x01\x01".ljust(16, b"\0") + struct.pack("<HHIQQQ", 3, 62, 1, 0, 64, end + len(rest) - 4)
    header += struct.pack("<IHHHHHH", 0, 64, 56, len(segments), 64, 1, 0)
    table = b"".join(struct.pack("<IIQQQQQQ", 1, 5, offset, 0, 0, size, size, 1) for offset, size in segments)
    return (header + table).ljust(end, b"c") + rest


@pytest.mark.parametrize("size", [0, 7, 100_000])
def test_a_library_is_installed_without_debug_information(size: int, tmp_path: Path, make_wheel: MakeWheel) -> None:
    whole = library([(0, 300), (300, size), (0, 0)], b"debug info" * 50_000)
    wheels = {"pybullet": whole, "other": whole}
    entries = [make_wheel(name, files={f"{name}.cpython-311.so": content}) for name, content in wheels.items()]
    install(entries, tmp_path / "wheels", target(tmp_path / "env"))
    site = tmp_path / "env/site-packages"
    found = (site / "pybullet.cpython-311.so").read_bytes()
    assert len(found) == 300 + size
    # Place and number of sections.
    assert (found[40:48], found[60:64]) == (bytes(8), bytes(4))
    assert found[:40] + found[48:60] + found[64:] == whole[:40] + whole[48:60] + whole[64 : 300 + size]
    assert (site / "other.cpython-311.so").read_bytes() == whole


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no library",
        b"\x7fELF\x02\x01",
        library([(0, 300)], b"rest").replace(b"\x7fELF\x02", b"\x7fELF\x01", 1),
        library([], b"rest"),
        # The headers of its segments lie elsewhere.
        library([(0, 300)], b"rest")[:32] + struct.pack("<Q", 2**40) + library([(0, 300)], b"rest")[40:],
    ],
)
def test_a_file_that_is_no_library_is_installed_whole(content: bytes, tmp_path: Path, make_wheel: MakeWheel) -> None:
    install([make_wheel("pybullet", files={"a.so": content})], tmp_path / "wheels", target(tmp_path / "env"))
    assert (tmp_path / "env/site-packages/a.so").read_bytes() == content
