"""The Dockerfile: what it copies is sent, its shell commands work as written, and its user needs no rights.

There may be no Docker here, so the instructions are executed in a folder that stands in for the root of the image.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCKERFILE = ROOT / "Dockerfile"
HADOLINT = Path(sys.executable).with_name("hadolint")
STRANGER = 12345  # a user without a name and without a home
IN_IMAGE = re.compile(r"/(?=(?:opt|usr/local)/)")
# Stands in for pip: the packages are those of this interpreter.
PIP = """\
import json, pathlib, sys, sysconfig
site = pathlib.Path(sysconfig.get_path("purelib"))
(site / "pybullet_data").mkdir()
(site / "pip/arguments.json").write_text(json.dumps(sys.argv[1:]))
"""


def instructions() -> list[tuple[str, str]]:
    text = re.sub(r"^\s*#.*\n", "", DOCKERFILE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = [line for line in text.replace("\\\n", " ").splitlines() if line]
    return [(name, rest.strip()) for name, _, rest in (line.partition(" ") for line in lines)]


def arguments_of(name: str) -> list[str]:
    return [rest for found, rest in instructions() if found == name]


def test_the_base_is_slim_and_its_digest_comes_from_the_release() -> None:
    assert arguments_of("ARG") == ["BASE=python:3.11-slim"]
    assert arguments_of("FROM") == ["$BASE"]


def test_the_command_runs_as_a_user_without_rights() -> None:
    names = [name for name, _ in instructions()]
    [user] = arguments_of("USER")
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert names.index("USER") > max(index for index, name in enumerate(names) if name in {"RUN", "COPY"})
    assert [json.loads(command) for command in arguments_of("ENTRYPOINT")] == [["sim-action"]]


def test_exactly_the_copied_files_are_sent_to_the_builder() -> None:
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line and line[0] not in "#!"] == ["*", "**/__pycache__"]
    sources = {source for copy in arguments_of("COPY") for source in copy.split()[:-1]}
    assert {line[1:] for line in lines if line.startswith("!")} == sources
    assert [source for source in sources if not (ROOT / source).exists()] == []


@pytest.mark.process
@pytest.mark.skipif(not HADOLINT.exists(), reason="hadolint has no wheel for this system")
def test_hadolint_finds_nothing_but_a_planted_mistake(tmp_path: Path) -> None:
    assert subprocess.run([HADOLINT, DOCKERFILE], capture_output=True, text=True, check=False).stdout == ""
    spoiled = tmp_path / "Dockerfile"
    spoiled.write_text(DOCKERFILE.read_text(encoding="utf-8").replace("USER 1000:1000", "USER root"), encoding="utf-8")
    said = subprocess.run([HADOLINT, spoiled], capture_output=True, text=True, check=False)
    assert (said.returncode, "DL3002" in said.stdout) == (1, True)


def usable_python() -> Path:
    """An interpreter of this version that other users may start, or else this one."""
    name = f"python3.{sys.version_info.minor}"
    candidates = [Path(sys.base_prefix, "bin", name), Path("/usr/bin", name)]
    return next((path for path in candidates if path.exists() and is_open(path)), candidates[0])


def is_open(path: Path) -> bool:
    return all(folder.stat().st_mode & 0o001 for folder in path.resolve().parents)


@pytest.fixture
def image() -> Iterator[Path]:
    """A folder with a Python and a stand-in of pip at the places of the base image; open to all users."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        local = folder / "usr/local"
        subprocess.run([usable_python(), "-m", "venv", "--without-pip", local], check=True)
        [site] = local.glob("lib/python*/site-packages")
        (site / "pip").mkdir()
        (site / "pip/__init__.py").touch()
        (site / "pip/__main__.py").write_text(PIP, encoding="utf-8")
        packages = next(path for path in map(Path, sys.path) if (path / "pydantic").is_dir())
        (site / "packages.pth").write_text(f"{packages}\n", encoding="utf-8")
        yield folder


def build(image: Path) -> dict[str, str]:
    """Execute the instructions in order and return the variables of the image."""
    variables = {"PATH": f"{image}/usr/local/bin:/usr/bin:/bin"}
    for name, rest in instructions():
        if name == "COPY":
            *sources, target = rest.split()
            copy(sources, image / target.lstrip("/"), is_folder=target.endswith("/"))
        elif name == "ENV":
            variables |= dict(entry.split("=", 1) for entry in shlex.split(rest))
        elif name == "RUN":
            in_folder = IN_IMAGE.sub(f"{image}/", rest)
            subprocess.run(["sh", "-ec", in_folder], env=variables, cwd="/", check=True)
    return variables


def copy(sources: list[str], target: Path, *, is_folder: bool) -> None:
    for source in sources:
        if (ROOT / source).is_dir():
            shutil.copytree(ROOT / source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            assert is_folder
            target.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / source, target)


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="the image is Linux")
def test_the_image_runs_a_scenario_for_any_user(image: Path) -> None:
    variables = build(image)
    [site] = image.glob("usr/local/lib/python*/site-packages")
    asked = json.loads((site / "pip/arguments.json").read_text(encoding="utf-8"))
    assert {"--require-hashes", "--no-deps", f"{image}/opt/sim-action/requirements.lock"} <= set(asked)
    assert asked[asked.index("--only-binary") + 1] == ":all:"
    assert not (site / "pybullet_data").exists()
    work = image / "work"
    work.mkdir()
    shutil.copy(ROOT / "examples/turtlebot3/straight_line.sim.yml", work)
    changes_user = os.geteuid() == 0 and is_open(usable_python())
    if changes_user:
        os.chown(work, STRANGER, STRANGER)
    ran = subprocess.run(
        [image / "usr/local/bin/sim-action", "run", "."],
        cwd=work,
        env=variables,
        user=STRANGER if changes_user else None,
        group=STRANGER if changes_user else None,
        extra_groups=[] if changes_user else None,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    report = work / "sim-results/report.html"
    assert report.stat().st_uid == (STRANGER if changes_user else os.geteuid())
