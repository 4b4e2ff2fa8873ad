"""The sdist and the wheel that release.yml builds from a clean export: what is in them, and that they work."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from email import message_from_string
from email.message import Message
from pathlib import Path

import pytest

from sim_action import __version__
from tests.integration.conftest import interpreter, locked
from tests.integration.release_steps import ROOT, Machine, named_step

VIEWER = "sim_action/reports/viewer/viewer3d.json"
BUILT = '{"packed": "", "sha256": ""}\n'
WHEEL = f"sim_action-{__version__}-py3-none-any.whl"
SDIST = f"sim_action-{__version__}.tar.gz"
PLUGIN = "plugins/pytest-sim-action"
PLUGIN_WHEEL = f"pytest_sim_action-{__version__}-py3-none-any.whl"
PLUGIN_SDIST = f"pytest_sim_action-{__version__}.tar.gz"


def export(folder: Path) -> Path:
    """What git has in it, and nothing that a build or a test has left."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is no checkout")
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in names:
        if name and (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The folder of both packages, for all workers of the session; npm and node are stand-ins, and write a viewer."""
    session = tmp_path_factory.getbasetemp()
    folder = (session if worker_id == "master" else session.parent) / "packages"
    folder.mkdir(exist_ok=True)
    machine = Machine(folder, version=__version__, programs={"npm": "", "node": f"echo '{BUILT.strip()}' > \"$2\""})
    with locked(folder / "lock"):
        if not (machine.temp / "plugin2").exists():
            source = export(folder / "source")
            for step in ("Build the viewer", "Build the sdists"):
                ran = machine.run("build", step, source)
                assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
            assert machine.called("npm") == ["ci --prefix tools/viewer"] * 2
    return machine.temp / "dist1"


@pytest.fixture(scope="module")
def wheel(packages: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    with zipfile.ZipFile(packages / WHEEL) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    text = (wheel / f"sim_action-{__version__}.dist-info/METADATA").read_text(encoding="utf-8")
    return message_from_string(text)


def test_there_is_one_sdist_and_one_wheel(packages: Path) -> None:
    assert sorted(file.name for file in packages.iterdir()) == sorted([SDIST, WHEEL])
    plugin = packages.with_name("plugin1")
    assert sorted(file.name for file in plugin.iterdir()) == sorted([PLUGIN_SDIST, PLUGIN_WHEEL])


def test_builds_that_differ_end_the_release(tmp_path: Path) -> None:
    machine = Machine(tmp_path, programs={"npm": "", "node": 'echo "$2" > "$2"'})
    ran = machine.run("build", "Build the viewer", tmp_path)
    assert ran.returncode == 1
    assert "differ" in ran.stdout
    # The last argument is the folder of the packages.
    machine = Machine(tmp_path, programs={"python": 'mkdir -p "${@: -1}"; echo "$*" > "${@: -1}/a"'})
    ran = machine.run("build", "Build the sdists", tmp_path)
    assert ran.returncode == 1
    assert "diff --recursive" in ran.stdout


def test_the_wheel_has_the_package_and_its_viewer_and_nothing_else(wheel: Path, packages: Path) -> None:
    assert {path.name for path in wheel.iterdir()} == {"sim_action", f"sim_action-{__version__}.dist-info"}
    assert (wheel / VIEWER).read_text(encoding="utf-8") == BUILT
    source = packages.parents[1] / "source"
    here = {path.relative_to(source) for path in (source / "sim_action").rglob("*") if path.is_file()}
    assert {path.relative_to(wheel) for path in (wheel / "sim_action").rglob("*") if path.is_file()} == here


def test_the_sdist_has_what_builds_and_tests_it(packages: Path) -> None:
    with tarfile.open(packages / SDIST) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "tools/hatch_build.py", "README.md", "LICENSE", VIEWER, "tests/test_docs.py"} <= names
    assert not [name for name in names if re.search(r"node_modules|__pycache__|\.venv|sim-results", name)]


def test_the_packages_of_the_plugin_have_its_module_and_the_license(packages: Path) -> None:
    plugin, info = packages.with_name("plugin1"), f"pytest_sim_action-{__version__}.dist-info"
    license_ = (ROOT / "LICENSE").read_bytes()
    assert (ROOT / PLUGIN / "LICENSE").read_bytes() == license_
    with zipfile.ZipFile(plugin / PLUGIN_WHEEL) as archive:
        assert archive.read(f"{info}/licenses/LICENSE") == license_
        assert {name for name in archive.namelist() if not name.startswith(info)} == {"pytest_sim_action.py"}
        metadata = message_from_string(archive.read(f"{info}/METADATA").decode())
    assert (metadata["Name"], metadata["Version"]) == ("pytest-sim-action", __version__)
    assert re.findall(r"\]\((?!https://|#)[^)]*\)", str(metadata.get_payload())) == []
    with tarfile.open(plugin / PLUGIN_SDIST) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names == {"LICENSE", "PKG-INFO", "README.md", "pyproject.toml", "pytest_sim_action.py", ".gitignore"}


@pytest.mark.soak
def test_pytest_finds_scenarios_where_the_plugin_is_installed(packages: Path, tmp_path: Path) -> None:
    environment = tmp_path / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    (site,) = environment.glob("lib/python3*/site-packages")
    wheels = [packages / WHEEL, packages.with_name("plugin1") / PLUGIN_WHEEL]
    into = ["--target", str(site), "--no-deps", "--no-index", "--quiet", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "install", *into, *wheels], check=True, env=without_pythonpath())
    # What both need is here already: it takes minutes to download.
    (site / "dependencies.pth").write_text(f"{Path(pytest.__file__).parents[1]}\n")
    python = str(environment / "bin/python")
    assert run(tmp_path, "init", "hello", python=python, PYTHONPATH="").returncode == 0
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    words = ("-m", "pytest", "-v", "-p", "no:cacheprovider", "hello")
    ran = interpreter(tmp_path, *words, python=python, env=without_pythonpath())
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "sim-action-" in ran.stdout
    assert "drive_straight.sim.yml::" in ran.stdout


def test_the_metadata_says_what_the_package_is(metadata: Message) -> None:
    assert (metadata["Name"], metadata["Version"]) == ("sim-action", __version__)
    assert (metadata["License-Expression"], metadata["Requires-Python"]) == ("Apache-2.0", ">=3.11")
    urls = {url.partition(",")[0] for url in metadata.get_all("Project-URL", [])}
    assert urls == {"Documentation", "Source", "Changelog", "Issues"}
    assert all(" https://github.com/sim-action/sim-action" in url for url in metadata.get_all("Project-URL", []))


def test_links_and_pictures_of_the_description_work_outside_of_the_repository(metadata: Message) -> None:
    assert metadata["Description-Content-Type"] == "text/markdown"
    text = str(metadata.get_payload())
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"\]\(", text)) == len(re.findall(r"\]\(", readme)) > 20
    assert re.findall(r"\]\((?!https://|#)[^)]*\)", text) == []
    assert re.findall(r"<(?:img|a)\b", text) == []
    tag = f"sim-action/sim-action/blob/v{__version__}"
    assert f"[Cookbook](https://github.com/{tag}/docs/cookbook.md)" in text
    (picture,) = re.findall(r"!\[[^\]]*\]\((https://raw\.[^)]*)\)", text)
    path = picture.removeprefix(f"https://raw.githubusercontent.com/sim-action/sim-action/v{__version__}/")
    assert (ROOT / path).is_file()


def run(
    folder: Path, *arguments: str, python: str = sys.executable, **variables: str
) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "COLUMNS": "120", **variables}
    return interpreter(folder, "-m", "sim_action", *arguments, python=python, env=environment)


# As cyclonedx-py does: it writes a file to the path after `--output-file`.
LISTING = 'while test "$1" != --output-file; do shift; done; echo "{}" > "$2"'


def build_folders(folder: Path, temp: Path) -> None:
    """Write a changelog, and files in place of those that the steps before have built."""
    (folder / "CHANGELOG.md").write_text(f"## {__version__} (2026-11-30)\n\nThe text.\n")
    for name in ("dist1", "plugin1", "viewer1"):
        (temp / name).mkdir(parents=True)
        (temp / name / "file").write_text(name)


def test_the_text_and_the_list_of_packages_are_written(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "tools/release", tmp_path / "tools/release")
    build_folders(tmp_path, tmp_path / "temp")
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text(encoding="utf-8"), encoding="utf-8")
    machine = Machine(tmp_path, version=__version__, programs={"cyclonedx-py": LISTING})
    ran = machine.run("build", "Write the text", tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (machine.temp / "release/notes.md").read_text(encoding="utf-8") == "The text.\n"
    project = (machine.temp / "pyproject.toml").read_text(encoding="utf-8")
    assert f'\nversion = "{__version__}"\n' in project
    assert "\ndynamic = " not in project
    summary = (machine.temp / "GITHUB_STEP_SUMMARY").read_text(encoding="utf-8")
    sums = re.findall(r"^[0-9a-f]{64}  (\S+)$", summary, re.MULTILINE)
    release = ["release/notes.md", f"release/sim-action-{__version__}.cdx.json"]
    assert sums == ["dist1/file", "plugin1/file", "viewer1/file", *release]


# Installs 200 MB from the package index.
@pytest.mark.soak
def test_an_empty_environment_installs_the_wheel_and_the_build_tools(packages: Path, tmp_path: Path) -> None:
    for name in ("clean", "tools"):
        subprocess.run([sys.executable, "-m", "venv", tmp_path / name], check=True)
    python = str(tmp_path / "clean/bin/python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", packages / WHEEL], check=True, env=without_pythonpath())
    assert run(tmp_path, "init", "hello", python=python, PYTHONPATH="").returncode == 0
    ran = run(tmp_path, "run", "hello", python=python, PYTHONPATH="")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (tmp_path / "sim-results/report.html").is_file()
    machine = Machine(tmp_path, version=__version__)
    path = os.pathsep.join([str(tmp_path / "tools/bin"), os.environ["PATH"]])
    source = export(tmp_path / "source")
    build_folders(source, machine.temp)
    for step in ("Install the build tools", "Write the text"):
        ran = machine.run("build", step, source, PATH=path)
        assert ran.returncode == 0, ran.stderr
    listed = json.loads((machine.temp / f"release/sim-action-{__version__}.cdx.json").read_text(encoding="utf-8"))
    assert listed["bomFormat"] == "CycloneDX"
    component = listed["metadata"]["component"]
    assert (component["name"], component["version"]) == ("sim-action", __version__)
    lock = (ROOT / "action/locks/requirements.lock").read_text(encoding="utf-8")
    locked = re.findall(r"^([\w-]+)==", lock, re.MULTILINE)
    assert sorted({component["name"] for component in listed["components"]}) == sorted(set(locked))
    hashed = [reference["hashes"] for each in listed["components"] for reference in each["externalReferences"]]
    assert len(hashed) == len(listed["components"])
    assert all(hashed)


def without_pythonpath() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def test_the_tools_that_build_a_release_are_locked_with_their_hashes() -> None:
    lock = (ROOT / "tools/release/requirements.txt").read_text(encoding="utf-8")
    wanted = (ROOT / "tools/release/requirements.in").read_text(encoding="utf-8")
    needed = set(re.findall(r"^([\w-]+)>=", wanted, re.MULTILINE))
    assert needed <= set(re.findall(r"^([\w-]+)==", lock, re.MULTILINE))
    entries = re.findall(r"^[\w-]+==.*\\\n(?: +--hash=sha256:[0-9a-f]{64}(?: \\)?\n)+", lock, re.MULTILINE)
    assert len(entries) == len(re.findall(r"^[^ #]", lock, re.MULTILINE))
    assert "://" not in lock
    assert "--require-hashes" in named_step("build", "Install the build tools")["run"]
