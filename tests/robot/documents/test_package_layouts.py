"""Layouts of folders as collections of models have them: the file or folder that is taken, or the error."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from sim_action.core.workspace import Workspace
from sim_action.robot.documents.package_search import Listings
from sim_action.robot.documents.packages import PackageError, Packages
from tests.ros_workspace import written


@dataclass(frozen=True)
class Layout:
    """Files, the reference in the first of them, and the file that it means or the rule of the error.

    `notes` are words that the notes contain, one text for each note.
    """

    files: str
    reference: str
    taken: str
    notes: tuple[str, ...] = ()
    environment: str = ""


_URDF = "arm/urdf/arm.urdf"
_LOOSE, _OWN = f"{_URDF} arm/m/a.stl", f"{_URDF} arm/package.xml arm/m/a.stl"
_STL, _TABLE = "arm/m/a.stl", "../models/table/m/a.stl"


def _mesh(files: str, taken: str = _STL, *notes: str, package: str = "arm") -> Layout:
    """Return a layout whose reference is the mesh m/a.stl of a package."""
    return Layout(files, f"package://{package}/m/a.stl", taken, notes)


LAYOUTS = {
    "own package": _mesh(_OWN),
    "folder above": _mesh(_LOOSE, _STL, "'arm': arm, above arm.urdf, is used"),
    "package.xml before a folder above": _mesh(f"{_LOOSE} src/x/package.xml=arm src/x/m/a.stl", "src/x/m/a.stl"),
    "nearest of two folders above": _mesh(
        "arm/old/arm/urdf/arm.urdf arm/m/a.stl arm/old/arm/m/a.stl", "arm/old/arm/m/a.stl", "arm/old/arm, above"
    ),
    "the folder above that has the file": _mesh("arm/old/arm/urdf/arm.urdf arm/m/a.stl", _STL, "'arm': arm, above"),
    "folder in the workspace": _mesh(
        f"{_URDF} parts/hand/m/a.stl",
        "parts/hand/m/a.stl",
        "parts/hand is used, a folder of that name; set robot.packages",
        package="hand",
    ),
    "folder in the workspace, not the folder above without the file": _mesh(
        f"{_URDF} parts/arm/m/a.stl", "parts/arm/m/a.stl", "parts/arm is used"
    ),
    "nearest of several folders": _mesh(
        f"{_URDF} b/hand/m/a.stl arm/c/hand/m/a.stl a/hand/m/a.stl",
        "arm/c/hand/m/a.stl",
        "nearest to arm.urdf, not a/hand, b/hand",
        package="hand",
    ),
    "equally near folders": _mesh(
        f"{_URDF} b/hand/m/a.stl a/hand/m/a.stl",
        "a/hand/m/a.stl",
        "a/hand is used, because it is nearest to arm.urdf, not b/hand",
        package="hand",
    ),
    "nearer folder without the file": _mesh(
        f"{_URDF} arm/hand/m/b.stl far/hand/m/a.stl", "far/hand/m/a.stl", "far/hand is used", package="hand"
    ),
    "folder of meshes as a package": Layout(
        f"{_URDF} arm/meshes/visual/a.stl",
        "package://visual/a.stl",
        "arm/meshes/visual/a.stl",
        ("arm/meshes/visual is used",),
    ),
    "package that was renamed": _mesh(
        _LOOSE,
        _STL,
        "no folder 'arm_description' has the file: arm, above arm.urdf, is used",
        package="arm_description",
    ),
    "folders left out": Layout(
        "drake/arm/urdf/arm.urdf drake/arm/m/a.stl",
        "package://drake/models/deep/arm/m/a.stl",
        "drake/arm/m/a.stl",
        ("'package://drake/models/deep/arm' is read as drake/arm",),
    ),
    "folder doubled": Layout(
        "arm/urdf/urdf/arm.urdf arm/urdf/urdf/m/a.stl",
        "package://arm/urdf/m/a.stl",
        "arm/urdf/urdf/m/a.stl",
        ("'package://arm/urdf' is read as arm/urdf/urdf",),
    ),
    "folder doubled in the reference": Layout(_OWN, "package://arm/arm/m/a.stl", _STL, ("is read as arm",)),
    "folder that the build installs elsewhere": Layout(
        f"{_URDF} arm/package.xml arm/description/m/v/a.stl",
        "package://arm/m/v/a.stl",
        "arm/description/m/v/a.stl",
        ("arm has no folder 'm/v' with the file: arm/description/m/v is used; set",),
    ),
    "two folders that the build may install": _mesh(
        f"{_URDF} arm/package.xml arm/a/b/m/a.stl arm/c/m/a.stl", "arm/c/m/a.stl", "arm/c/m is used, not arm/a/b/m"
    ),
    "own package without the file": _mesh(f"{_URDF} arm/package.xml other/arm/m/a.stl", "missing-file"),
    "folder with another package": _mesh(
        f"{_URDF} hand/package.xml=gripper hand/m/a.stl", "missing-package", package="hand"
    ),
    "no such package": Layout(_LOOSE, "package://hand/m/b.stl", "missing-package"),
    "name that is too long": Layout(_LOOSE, f"package://{'a' * 300}/m/b.stl", "missing-package"),
    "no such file": Layout(_LOOSE, "package://arm/m/zz.stl", "missing-file"),
    "folder beside the workspace": _mesh(f"{_URDF} ../hand/m/a.stl ../m/b.stl", "missing-package", package="hand"),
    "up and out of the folder": Layout(
        f"{_URDF} ../hand/m/a.stl", "package://arm/../../hand/m/a.stl", "outside-workspace"
    ),
    "model without model.config": Layout(
        "arm/model.sdf table/m/a.stl", "model://table/m/a.stl", "table/m/a.stl", ("table is used",)
    ),
    "model on the model path, without model.config": Layout(
        "arm/model.sdf ../models/table/m/a.stl", "model://table/m/a.stl", _TABLE, (), "models"
    ),
    "package on the model path": Layout(
        f"{_URDF} ../models/table/m/a.stl", "package://table/m/a.stl", _TABLE, (), "models"
    ),
    "hidden folder on the model path": Layout(
        "arm/model.sdf ../models/.ssh/a.stl", "model://.ssh/a.stl", "missing-package", (), "models"
    ),
    "other letter case": Layout(
        f"{_URDF} arm/package.xml arm/Meshes/A.STL",
        "package://arm/meshes/a.stl",
        "arm/Meshes/A.STL",
        ("'meshes/a.stl' is spelled arm/Meshes/A.STL on the disk",),
    ),
    "other letter case, relative": Layout(
        f"{_URDF} arm/m/A.stl arm/m/a.STL", "../M/a.stl", "arm/m/A.stl", ("is spelled arm/m/A.stl",)
    ),
    "backslashes": Layout(_LOOSE, r"..\m\a.stl", _STL, ("is spelled arm/m/a.stl",)),
    "backslashes in an address": Layout(
        _OWN, r"package:\\arm\m\a.stl", _STL, (r"'package:\\arm' is read as 'package://arm/'",)
    ),
    "one slash": Layout(_OWN, "package:/arm/m/a.stl", _STL, ("'package:/arm' is read as 'package://arm/'",)),
    "three slashes": Layout(_OWN, "package:///arm/m/a.stl", _STL, ("'package:///arm' is read as 'package://arm/'",)),
    "two slashes after the name": Layout(_OWN, "package://arm//m/a.stl", _STL),
    "spaces around": Layout(_OWN, " package://arm/m/a.stl\n", _STL),
    "percent signs": Layout(f"{_URDF} arm/m/a b.stl", "package://arm/m/a%20b.stl", "arm/m/a b.stl", ("above",)),
    "file:// with a relative path": Layout(
        f"{_URDF} arm/urdf/m/a.stl", "file://m/a.stl", "arm/urdf/m/a.stl", ("'file://m' is read as a relative path",)
    ),
    "file:// with the name of a model": Layout(
        "models/arm/model.sdf models/table/m/a.stl",
        "file://table/m/a.stl",
        "models/table/m/a.stl",
        ("models/table is used",),
    ),
    "file:// of another machine": Layout(_LOOSE, "file:///home/you/arm/m/a.stl", "outside-workspace"),
}


def _packages(layout: Layout, root: Path) -> tuple[Packages, Path]:
    """Write the files of a layout. Return its packages, and the file that refers."""
    for name in layout.files.replace(" b.stl", "\0b.stl").split():
        path, _, package = name.replace("\0", " ").partition("=")
        manifest = f"<package><name>{package or (root / path).parent.name}</name></package>"
        written(root / path, manifest if path.endswith("package.xml") else "")
    environment = {"GAZEBO_MODEL_PATH": str(root.parent / layout.environment)} if layout.environment else {}
    return Packages(Workspace(root, root), environment=environment), root / layout.files.split()[0]


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_the_file_of_a_layout_is_taken(layout: Layout, tmp_path: Path) -> None:
    root = tmp_path.resolve() / "repository"
    packages, referrer = _packages(layout, root)
    if "/" not in layout.taken:
        with pytest.raises(PackageError) as raised:
            packages.resolve(layout.reference, referrer)
        assert raised.value.rule == layout.taken, raised.value
        return
    found = packages.resolve(layout.reference, referrer)
    assert found.path == (root / layout.taken).resolve()
    assert len(found.notes) == len(layout.notes), found.notes
    for note, words in zip(found.notes, layout.notes, strict=True):
        assert words in note.text


def test_a_folder_above_the_workspace_is_named_in_the_error(tmp_path: Path) -> None:
    root = tmp_path.resolve() / "arm/urdf"
    packages, referrer = _packages(Layout("arm.urdf ../m/a.stl", "", ""), root)
    with pytest.raises(PackageError, match=rf"--package arm={root.parent} \(in the action: the input packages\)$"):
        packages.resolve("package://arm/m/a.stl", referrer)


def test_outside_of_the_workspace_a_folder_beside_the_model_has_the_name(tmp_path: Path) -> None:
    folder, root = tmp_path.resolve() / "arm", tmp_path.resolve() / "repository"
    _, referrer = _packages(Layout("arm.urdf meshes/visual/a.stl", "", ""), folder)
    found = Packages(Workspace(root, root, allow_outside=True), environment={}).resolve(
        "package://meshes/visual/a.stl", referrer
    )
    assert found.path == folder / "meshes/visual/a.stl"
    with pytest.raises(PackageError, match="was not found"):
        Packages(Workspace(root, root), environment={}).resolve("package://meshes/visual/a.stl", referrer)


@pytest.mark.parametrize("package", ["far/package.xml=hand", "arm/package.xml=hand"])
def test_a_package_without_the_file_names_the_folder_that_has_it(package: str, tmp_path: Path) -> None:
    root = tmp_path.resolve()
    packages, referrer = _packages(Layout(f"{_URDF} {package} near/hand/m/a.stl", "", ""), root)
    with pytest.raises(
        PackageError, match=r"does not exist.*; the file is in near/hand, which robot.packages, --package or"
    ):
        packages.resolve("package://hand/m/a.stl", referrer)
    with pytest.raises(PackageError) as refused:
        packages.resolve("package://hand/m/other.stl", referrer)
    assert "the file is in" not in str(refused.value)


def test_the_note_on_the_letter_case_names_similar_files(tmp_path: Path) -> None:
    packages, referrer = _packages(Layout(f"{_URDF} arm/urdf/m.obj arm/urdf/m.OBJ", "", ""), tmp_path.resolve())
    (note,) = packages.resolve("M.obj", referrer).notes
    assert note.text.startswith("'M.obj' is spelled arm/urdf/m.OBJ on the disk")
    assert note.text.endswith("; not m.obj")


def test_two_notes_about_one_folder_are_equal_for_all_files(tmp_path: Path) -> None:
    layout = Layout(f"{_URDF} x/hand/m/a.stl x/hand/m/b.stl", "", "")
    packages, referrer = _packages(layout, tmp_path.resolve())
    notes = {packages.resolve(f"package://hand/m/{name}.stl", referrer).notes for name in "ab"}
    assert len(notes) == 1


def test_a_link_leads_neither_out_nor_to_a_folder_of_the_name(tmp_path: Path) -> None:
    root = tmp_path.resolve() / "repository"
    packages, referrer = _packages(Layout(f"{_URDF} ../hand/m/a.stl", "", ""), root)
    (root / "hand").symlink_to(root.parent / "hand")
    with pytest.raises(PackageError):
        packages.resolve("package://hand/m/a.stl", referrer)
    with pytest.raises(PackageError, match="outside the workspace"):
        packages.resolve("../../hand/M/a.stl", referrer)


def test_find_returns_the_folder_of_the_name(tmp_path: Path) -> None:
    packages, referrer = _packages(Layout(f"{_URDF} b/hand/x.xacro a/hand/x.xacro", "", ""), tmp_path.resolve())
    found = packages.find("hand", referrer)
    assert found.path == tmp_path.resolve() / "a/hand"
    assert [note.rule for note in found.notes] == ["package-folder"]
    assert packages.find("arm", referrer).path == tmp_path.resolve() / "arm"


def test_an_included_file_may_be_deeper_in_the_source_of_its_package(tmp_path: Path) -> None:
    root = tmp_path.resolve()
    packages, _ = _packages(Layout("arm/package.xml arm/description/m/a.xacro", "", ""), root)
    found = packages.included(root / "arm/m/a.xacro", "$(find arm)/m/a.xacro")
    assert found.path == root / "arm/description/m/a.xacro"
    assert [note.rule for note in found.notes] == ["package-folder"]
    assert packages.included(found.path, "a.xacro").notes == ()
    for missing in ("arm/a.xacro", "arm/m/b.xacro", "m/a.xacro", "arm/x/../m/b.xacro"):
        with pytest.raises(PackageError, match="does not exist"):
            packages.included(root / missing, missing)


def test_an_exact_name_comes_before_other_letters(tmp_path: Path) -> None:
    for name in ("A.stl", "a.stl", "a.STL"):
        written(tmp_path / "m" / name, "")
    listings = Listings()
    assert listings.matched(tmp_path, "M/a.stl", Path.is_dir) == tmp_path / "m/a.stl"
    assert listings.matched(tmp_path, "M/a.Stl", Path.is_dir) == tmp_path / "m/A.stl"
    assert listings.matched(tmp_path / "m", r"..\M\A.STL", Path.is_dir) == tmp_path / "m/A.stl"
    assert listings.matched(tmp_path, "m/a\0b", Path.is_dir) is None
    assert listings.matched(tmp_path, "m/a.stl", Path.is_file) is None
