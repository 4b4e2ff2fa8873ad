"""Packages and models by name, without ROS; folders that are searched; the file of a Gazebo model."""

from __future__ import annotations

import os
import pickle
import sys
from pathlib import Path

import pytest

from sim_action.core.workspace import Workspace
from sim_action.robot.documents import package_search
from sim_action.robot.documents.package_search import folders_below, package_name
from sim_action.robot.documents.packages import PackageError, Packages, find_model_file
from tests.ros_workspace import RosWorkspace, gazebo_model, ros_package, written

BOTH = {"AMENT_PREFIX_PATH": "{e}", "ROS_PACKAGE_PATH": "{e}/src"}

SEARCHES = {
    "across the workspace": ("", "rover_sensors", "w/src/rover_sensors", {}),
    "own package": ("w/src/a_copy/rover_description", "rover_description", "w/src/rover_description", {}),
    "name of package.xml": ("w/src/checkout=rover_arm", "rover_arm", "w/src/checkout", {}),
    "name of the folder": ("w/src/checkout=rover_arm", "checkout", "", {}),
    **{
        f"below {tool}": (f"w/{tool}/rover_arm", "rover_arm", "", {})
        for tool in (".hidden", "node_modules", "build", "install", "devel", "log")
    },
    "below a root": ("e/roots/stack/arm", "arm", "e/roots/stack/arm", {"ROS_PACKAGE_PATH": "{e}/absent:{e}/roots"}),
    "a root that is a package": ("e/arm", "arm", "e/arm", {"ROS_PACKAGE_PATH": "{e}/roots:{e}/arm"}),
    "a package in another one": ("e/outer e/outer/inner", "inner", "", {"ROS_PACKAGE_PATH": "{e}"}),
    "first prefix": ("e/o/share/arm e/u/share/arm", "arm", "e/o/share/arm", {"AMENT_PREFIX_PATH": "{e}/o:{e}/u"}),
    "workspace first": ("e/share/rover_sensors e/src/rover_sensors", "rover_sensors", "w/src/rover_sensors", BOTH),
    "ROS_PACKAGE_PATH before AMENT_PREFIX_PATH": ("e/share/arm e/src/arm", "arm", "e/src/arm", BOTH),
    "relative entries": ("e/arm", "arm", "", {"ROS_PACKAGE_PATH": "{relative}", "AMENT_PREFIX_PATH": "::."}),
    **{
        f"a path, {name!r}": ("e/share/a/b", name, "", {"AMENT_PREFIX_PATH": "{e}"})
        for name in ("..", ".", "", "a/b", "/etc", "a\0b")
    },
}
"""Packages besides those of the workspace, a name, the folder that is found (empty: none), and the environment.

w: the workspace; e: a folder beside it.
"""


@pytest.mark.parametrize("search", SEARCHES.values(), ids=SEARCHES)
def test_a_package_is_found_by_name(
    search: tuple[str, str, str, dict[str, str]], ros: RosWorkspace, elsewhere: Path
) -> None:
    made, name, expected, variables = search

    def place(text: str) -> Path:
        return {"w": ros.root, "e": elsewhere}[text[0]] / text[2:]

    for package in made.split():
        folder, _, stated = package.partition("=")
        ros_package(place(folder), stated or None)
    folders = {"e": elsewhere, "relative": os.path.relpath(elsewhere)}
    packages = ros.packages(environment={key: value.format(**folders) for key, value in variables.items()})
    if expected:
        found = packages.find(name, ros.rover)
        assert (found.path, found.notes) == (place(expected), ())
    else:
        with pytest.raises(PackageError):
            packages.find(name, ros.rover)


def test_the_map_of_the_scenario_comes_first_and_needs_no_package_xml(ros: RosWorkspace) -> None:
    part = written(ros.root / "cad/part.stl", "")
    gazebo_model(ros.root / "models/table")
    packages = ros.packages(dict.fromkeys(("rover_sensors", "table"), "../cad"))
    assert packages.find("rover_sensors", ros.rover) == packages.find_model("table", ros.rover)
    assert (packages.find("table", ros.rover).path, packages.find("table", ros.rover).notes) == (part.parent, ())
    assert packages.resolve("package://rover_sensors/part.stl", ros.rover).path == part


@pytest.mark.parametrize(
    ("stated", "rule", "message"),
    [
        ("../vendor", "missing-package", r"'rover: \.\./vendor' in robot\.packages is not a folder \(looked for .*/ve"),
        ("drive.sim.yml", "missing-package", "is not a folder"),
        ("../../elsewhere", "outside-workspace", r"is outside the workspace .*; allow it with --allow-outside"),
        ("a\0b", "missing-package", "is not a valid path: .*embedded null"),
        ("a" * 300, "missing-package", "is not a valid path|is not a folder"),
    ],
)
def test_a_map_to_no_folder_is_refused(
    stated: str, rule: str, message: str, ros: RosWorkspace, elsewhere: Path
) -> None:
    with pytest.raises(PackageError, match=message) as raised:
        ros.packages({"rover": stated}).find("rover", ros.rover)
    assert raised.value.rule == rule


def test_of_two_packages_of_one_name_the_nearer_wins_with_a_warning(ros: RosWorkspace) -> None:
    far = ros_package(ros.root / "another/place/rover_arm")
    near = ros_package(ros.root / "src/zz/rover_arm")
    found = ros.packages().find("rover_arm", ros.rover)
    assert found.path == near
    reason = f"{near} is used, because it is nearest to rover.urdf.xacro, not {far}; set robot.packages to choose one"
    assert [note.text for note in found.notes] == [f"2 packages have the same name: {reason}"]
    assert ros.packages().find("rover_arm", ros.root / "another/robot.urdf").path == far
    # Of equally near ones, the first in the order of the alphabet.
    first = ros_package(ros.root / "src/aa/rover_arm")
    assert ros.packages().find("rover_arm", ros.rover).path == first


@pytest.mark.parametrize("marker", ["CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE"])
def test_folders_that_ros_ignores_are_ignored(marker: str, ros: RosWorkspace) -> None:
    folder = ros_package(ros.root / "src/old/rover_arm")
    assert ros.packages().find("rover_arm", ros.rover).path == folder
    written(ros.root / "src/old" / marker, "")
    with pytest.raises(PackageError):
        ros.packages().find("rover_arm", ros.rover)


def test_a_package_in_another_is_found_and_links_to_folders_are_not_followed(
    ros: RosWorkspace, elsewhere: Path
) -> None:
    ros_package(elsewhere / "rover_arm")
    (ros.root / "src/linked").symlink_to(elsewhere)
    (ros.root / "src/circle").symlink_to(ros.root)
    with pytest.raises(PackageError):
        ros.packages().find("rover_arm", ros.rover)
    assert ros.packages().find("rover_sensors", ros.rover).notes == ()
    ros_package(ros.root, "everything")
    assert ros.packages().find("rover_sensors", ros.root / "robot.urdf").path == ros.sensors


def test_a_missing_package_is_told_with_who_refers_to_it_and_where_it_was_looked_for(ros: RosWorkspace) -> None:
    packages = ros.packages(environment={"AMENT_PREFIX_PATH": "/nowhere/ros"})
    with pytest.raises(PackageError) as raised:
        packages.find("rover_sensor", ros.rover)
    assert raised.value.rule == "missing-package"
    assert str(raised.value) == (
        "src/rover_description/urdf/rover.urdf.xacro refers to the package 'rover_sensor', which was not found; "
        "did you mean 'rover_sensors'? "
        f"(searched: robot.packages, {ros.root} (2 packages), ROS_PACKAGE_PATH (not set), "
        "AMENT_PREFIX_PATH (/nowhere/ros)); "
        "add it to the repository, or set its folder: robot.packages: {rover_sensor: path/to/rover_sensor}, "
        "or name a folder outside the repository: --package rover_sensor=FOLDER (in the action: the input packages)"
    )


def test_a_package_of_the_caller_comes_first_and_may_be_outside(ros: RosWorkspace, elsewhere: Path) -> None:
    written(elsewhere / "meshes/part.stl", "")
    written(elsewhere / ".git/config", "")
    written(elsewhere.parent / "beside.stl", "")
    workspace = Workspace(ros.root / "sim", ros.root, packages=(("rover_sensors", str(elsewhere)),))
    packages = Packages(workspace, {"rover_sensors": "../vendor"}, {})
    assert packages.find("rover_sensors", ros.rover).path == elsewhere
    assert packages.find_model("rover_sensors", ros.rover).path == elsewhere
    found = packages.resolve("package://rover_sensors/meshes/part.stl", ros.rover)
    assert found.path == elsewhere / "meshes/part.stl"
    for path in (".git/config", "../beside.stl"):
        with pytest.raises(PackageError, match="outside the workspace"):
            packages.resolve(f"package://rover_sensors/{path}", ros.rover)


def test_what_was_found_is_kept_and_goes_to_a_child_process(ros: RosWorkspace) -> None:
    packages = ros.packages({"a": "b"}, {"ROS_PACKAGE_PATH": "/x"})
    packages.find("rover_sensors", ros.rover)
    assert pickle.loads(pickle.dumps(packages)) == packages
    ros_package(ros.root / "src/rover_arm")
    with pytest.raises(PackageError):
        packages.find("rover_arm", ros.rover)
    assert ros.packages().find("rover_arm", ros.rover)


def test_a_model_is_a_folder_or_a_package_of_that_name(ros: RosWorkspace) -> None:
    folder = gazebo_model(ros.root / "models/table")
    packages = ros.packages()
    assert packages.find_model("table", ros.rover).path == folder
    assert packages.resolve("model://table/model.sdf", ros.rover).path == folder / "model.sdf"
    found = packages.resolve("model://rover_sensors/meshes/lidar.stl", ros.rover)
    assert found.path == ros.sensors / "meshes/lidar.stl"
    with pytest.raises(PackageError, match=r"refers to the model 'tabel', .*did you mean 'table'\?") as raised:
        packages.resolve("model://tabel/model.sdf", ros.rover)
    assert raised.value.rule == "missing-package"
    assert "GAZEBO_MODEL_PATH (not set), GZ_SIM_RESOURCE_PATH (not set), ROS_PACKAGE_PATH" in str(raised.value)


@pytest.mark.parametrize("variable", ["GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH"])
def test_models_of_the_machine_are_found(variable: str, ros: RosWorkspace, elsewhere: Path) -> None:
    folder = gazebo_model(elsewhere / "table")
    (elsewhere / "no_model").mkdir()
    packages = ros.packages(environment={variable: str(elsewhere)})
    assert packages.resolve("model://table/model.sdf", ros.rover).path == folder / "model.sdf"
    with pytest.raises(PackageError):
        packages.find_model("no_model", ros.rover)


@pytest.mark.parametrize("variable", ["GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "ROS_PACKAGE_PATH"])
@pytest.mark.parametrize("path", [".git/t.stl", "meshes/.GIT/t.stl"])
def test_git_folders_of_models_of_the_machine_are_not_read(
    variable: str, path: str, ros: RosWorkspace, elsewhere: Path
) -> None:
    model = gazebo_model(ros_package(elsewhere / "cart"))
    written(model / path, "")
    packages = ros.packages(environment={variable: str(elsewhere)})
    for reference in (f"model://cart/{path}", f"file://{model / path}", f"package://cart/{path}"):
        with pytest.raises(PackageError):
            packages.resolve(reference, ros.rover)


def test_references_lead_to_files(ros: RosWorkspace) -> None:
    packages = ros.packages()
    mesh = ros.description / "meshes/base.stl"
    named = ("package://rover_description/meshes/base.stl", "../meshes/base.stl")
    for reference in (*named, f"file://{mesh}", f"file://localhost{mesh}", str(mesh)):
        assert packages.resolve(reference, ros.rover).path == mesh
    # A relative path begins at the real place of the file that refers.
    link = ros.root / "robot.xacro"
    link.symlink_to(ros.rover)
    assert packages.resolve("../meshes/base.stl", link).path == mesh


def test_spaces_may_be_written_as_in_addresses(ros: RosWorkspace) -> None:
    spaced = ros.write("src/rover_description/meshes/left arm.stl", "")
    percent = ros.write("src/rover_description/meshes/left%20arm 2.stl", "")
    packages = ros.packages()
    assert packages.resolve("package://rover_description/meshes/left%20arm.stl", ros.rover).path == spaced
    assert packages.resolve("package://rover_description/meshes/left arm.stl", ros.rover).path == spaced
    assert packages.resolve("package://rover_description/meshes/left%20arm 2.stl", ros.rover).path == percent


AWAY = "../../../../elsewhere/a.stl"
BETTER = "a path relative to the referring file, or package://"


@pytest.mark.parametrize(
    ("reference", "rule", "message"),
    [
        ("package://rover_description/meshes/bas.stl", "missing-file", r"does not exist .*did you mean 'base.stl'\?$"),
        ("package://rover_description/absent/a.stl", "missing-file", r"does not exist \(looked for .*absent/a.stl\)$"),
        ("../meshes", "missing-file", r"'\.\./meshes' is a folder"),
        ("package://rover_description", "bad-reference", "names no file; write package://name/path/of/the/file"),
        ("package:///", "bad-reference", "names no file"),
        ("package:///mesh/base.stl", "missing-package", "the package 'mesh', which was not found"),
        ("model://rover_description/", "bad-reference", "names no file"),
        (
            "http://a.org/a.stl",
            "bad-reference",
            "is not a valid reference; allowed are package://name/path, model://na",
        ),
        ("file://meshes/a.stl", "bad-reference", "needs an absolute path; write file:///meshes/a.stl, or 'meshes/a."),
        ("a\0b", "bad-reference", "is not a valid path: .*embedded null"),
        ("a" * 300, "bad-reference", "is not a valid path: .*File name too long"),
        ("package://rover_description/../../../elsewhere/a.stl", "outside-workspace", "is outside the workspace"),
        (AWAY, "outside-workspace", r"is outside .* \(it is .*/elsewhere/a.stl\); allow it with --allow"),
        ("file:///etc/passwd", "outside-workspace", rf"with --allow-outside .* packages\); better: {BETTER}"),
        ("/etc/passwd", "outside-workspace", "or package://, works on every machine$"),
        ("link.stl", "outside-workspace", "is outside"),
        ("package:/arm/a.stl", "missing-package", "the package 'arm', which was not found"),
        ("file:/arm/a.stl", "outside-workspace", r"it is /arm/a.stl\)"),
        ("pipe.stl", "missing-file", r"'pipe.stl' is not a regular file \(looked for .*/urdf/pipe.stl\)$"),
    ],
)
def test_what_leads_to_no_file_is_refused(
    reference: str, rule: str, message: str, ros: RosWorkspace, elsewhere: Path
) -> None:
    written(elsewhere / "a.stl", "")
    (ros.description / "urdf/link.stl").symlink_to(elsewhere / "a.stl")
    os.mkfifo(ros.description / "urdf/pipe.stl")
    with pytest.raises(PackageError, match=message) as raised:
        ros.packages().resolve(reference, ros.rover)
    assert raised.value.rule == rule


@pytest.mark.parametrize("reference", [AWAY, "link.stl", "package://arm/a.stl"])
def test_allow_outside_lifts_the_bounds(reference: str, ros: RosWorkspace, elsewhere: Path) -> None:
    written(elsewhere / "a.stl", "")
    (ros.description / "urdf/link.stl").symlink_to(elsewhere / "a.stl")
    packages = ros.packages({"arm": str(elsewhere)}, allow_outside=True)
    assert packages.resolve(reference, ros.rover).path == elsewhere / "a.stl"
    assert packages.find("rover_sensors", ros.rover).path == ros.sensors


def test_files_of_provided_packages_are_in_bounds(ros: RosWorkspace, elsewhere: Path) -> None:
    for variable, place in (("ROS_PACKAGE_PATH", "arm"), ("AMENT_PREFIX_PATH", "share/arm")):
        folder = ros_package(elsewhere / variable / place)
        mesh = written(folder / "meshes/a.stl", "")
        packages = ros.packages(environment={variable: str(elsewhere / variable)})
        assert packages.resolve("package://arm/meshes/a.stl", ros.rover).path == mesh
        # As $(find arm) leaves it in a URDF.
        assert packages.resolve(f"file://{mesh}", ros.rover).path == mesh
        assert packages.resolve("../meshes/a.stl", folder / "urdf/arm.urdf").path == mesh


def test_provided_packages_lead_nowhere_else(ros: RosWorkspace, elsewhere: Path) -> None:
    secret = written(elsewhere / "secret.txt", "")
    loose = written(elsewhere / "src/loose.txt", "")
    arm = ros_package(elsewhere / "src/arm")
    (arm / "link.txt").symlink_to(secret)
    model = gazebo_model(elsewhere / "models/table")
    written(elsewhere / "models/loose.txt", "")
    environment = {"ROS_PACKAGE_PATH": f"{elsewhere}/src", "GAZEBO_MODEL_PATH": f"{elsewhere}/models"}
    packages = ros.packages(environment=environment)
    for reference, referrer in (
        ("../../secret.txt", arm / "arm.urdf"),
        ("../loose.txt", arm / "arm.urdf"),
        ("link.txt", arm / "arm.urdf"),
        ("package://arm/link.txt", ros.rover),
        ("package://arm/../loose.txt", ros.rover),
        (f"file://{loose}", ros.rover),
        ("../loose.txt", model / "model.sdf"),
    ):
        with pytest.raises(PackageError) as raised:
            packages.resolve(reference, referrer)
        assert raised.value.rule == "outside-workspace", reference
    # A package beside the named folders is not provided.
    other = written(ros_package(elsewhere / "src2/arm") / "a.stl", "")
    with pytest.raises(PackageError, match="outside the workspace"):
        packages.resolve(str(other), ros.rover)
    # It may refer to the workspace.
    found = packages.resolve("package://rover_sensors/meshes/lidar.stl", arm / "arm.urdf")
    assert found.path == ros.sensors / "meshes/lidar.stl"


def test_only_the_first_files_that_are_missing_are_looked_for_by_another_name(ros: RosWorkspace) -> None:
    packages, scanned = ros.packages(), 0
    written(ros.rover.parent / "wheel.stl", "")
    for number in range(20):
        with pytest.raises(PackageError) as raised:
            packages.resolve(f"wheel{number}.stl", ros.rover)
        scanned += "did you mean 'wheel.stl'?" in str(raised.value)
    assert scanned == 10
    with pytest.raises(PackageError) as raised:
        packages.find("rover_sensor", ros.rover)
    assert "did you mean" not in str(raised.value)


@pytest.mark.parametrize("system", ["linux", "win32"])
def test_an_address_with_a_drive_is_a_path_on_windows_alone(
    system: str, ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Here, no file is called so: the message says which would be.
    monkeypatch.setattr(sys, "platform", system)
    with pytest.raises(PackageError) as refused:
        ros.packages().resolve("file:///C:/meshes/a.stl", ros.rover)
    place = Path("/C:/meshes/a.stl" if system == "linux" else "C:/meshes/a.stl").resolve()
    assert str(place) in str(refused.value)


def test_links_in_a_circle_are_refused_with_a_remedy(ros: RosWorkspace) -> None:
    link = ros.rover.parent / "circle.stl"
    link.symlink_to("circle.stl")
    # Python 3.13 finds no file there.
    with pytest.raises(PackageError, match=r"a link leads to itself.*; replace it with a file$|does not exist"):
        ros.packages().resolve("circle.stl", ros.rover)
    with pytest.raises(PackageError, match=r"a link leads to itself.*; replace it with a folder$|is not a folder"):
        ros.packages({"rover": str(link)}).find("rover", ros.rover)


@pytest.mark.parametrize("reference", ["q/m.stl", "Q/m.stl", "package://rover_sensors/Q/m.stl", "Q/../m.stl"])
def test_a_loop_of_links_hides_no_other_folder(reference: str, ros: RosWorkspace) -> None:
    for folder in (ros.rover.parent, ros.sensors, ros.root, ros.root / "src"):
        (folder / "q").symlink_to("q")
    (ros.root / "src/r").mkdir()
    (ros.root / "src/r/package.xml").symlink_to("package.xml")
    packages = ros.packages()
    with pytest.raises(PackageError):
        packages.resolve(reference, ros.rover)
    assert packages.find("rover_sensors", ros.rover).path == ros.sensors


@pytest.mark.parametrize("reference", ["package://p/" + "a/" * 101 + "m.stl", "m" * 5_000, "a\\" * 101])
def test_the_length_of_a_reference_is_limited(reference: str, ros: RosWorkspace) -> None:
    with pytest.raises(PackageError, match="too long for a reference") as error:
        ros.packages().resolve(reference, ros.rover)
    assert len(str(error.value)) < 200


def test_a_package_xml_may_not_be_a_link_into_git(ros: RosWorkspace) -> None:
    written(ros.root / ".git/x", "<package><name>secret</name></package>")
    (ros.root / "src/p").mkdir()
    (ros.root / "src/p/package.xml").symlink_to(ros.root / ".git/x")
    with pytest.raises(PackageError):
        ros.packages().find("secret", ros.rover)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("<package>\n  <name>\n rover </name></package>", "rover"),
        ("<package><author><name>someone</name></author><name>rover</name></package>", "rover"),
        ('<?xml version="1.0" encoding="ISO-8859-1"?><package><name>rover</name></package>', "rover"),
        ("<package><author><name>someone</name></author></package>", "folder"),
        ("<package><name></name></package>", "folder"),
        ("<package><name>rover</name>", "folder"),
        ("", "folder"),
        ('<!DOCTYPE p [<!ENTITY n "rover">]><package><name>&n;</name></package>', "folder"),
        ('<?xml version="1.0" encoding="nonsense"?><package><name>rover</name></package>', "folder"),
        (f"<package><name>rover</name>{' ' * 2_000_000}</package>", "folder"),
    ],
)
def test_a_package_xml_that_says_no_name_leaves_the_folders(text: str, name: str, tmp_path: Path) -> None:
    written(tmp_path / "folder/package.xml", text)
    assert package_name(tmp_path / "folder") == name
    # A pipe in its place holds nobody up.
    (tmp_path / "other").mkdir()
    os.mkfifo(tmp_path / "other/package.xml")
    assert package_name(tmp_path / "other") == "other"


def test_too_many_folders_are_said_to_be_too_many(ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package_search, "_MAX_FOLDERS", 4)
    assert not folders_below(ros.root, inside_packages=True).complete
    with pytest.raises(PackageError, match=r"only some of its folders: there are too many"):
        ros.packages().find("rover_arm", ros.rover)


def test_what_is_too_deep_is_not_looked_into(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*"abcdefghijklmnopq")
    ros_package(deep.parent)
    found = folders_below(tmp_path, inside_packages=True)
    assert (found.complete, "p" in found.packages) == (True, True)
    ros_package(deep)
    found = folders_below(tmp_path, inside_packages=True)
    assert (found.complete, "q" in found.packages) == (False, False)


def found(folder: Path, reference: str) -> Path:
    packages = Packages(Workspace(folder, folder), environment={})
    return find_model_file(reference, folder / "robot.sdf", packages).path.relative_to(folder)


def test_a_path_is_relative_to_the_file_behind_a_link(tmp_path: Path) -> None:
    written(tmp_path / "models/rover.sdf", "")
    written(tmp_path / "models/scene.sdf", "")
    (tmp_path / "robot.sdf").symlink_to(tmp_path / "models/scene.sdf")
    assert found(tmp_path, "./rover.sdf") == Path("models/rover.sdf")


def manifest(folder: Path, inside: str) -> None:
    written(folder / "rover/model.config", f"<model>{inside}</model>")


@pytest.mark.parametrize("reference", ["model://rover", "model://rover/", "rover", "./rover", "rover/model.sdf"])
def test_a_folder_without_a_manifest_has_its_model(reference: str, tmp_path: Path) -> None:
    written(tmp_path / "rover/model.sdf", "")
    assert found(tmp_path, reference) == Path("rover/model.sdf")


def test_the_newest_version_that_is_read_counts(tmp_path: Path) -> None:
    for name in ("a", "b", "c", "d"):
        written(tmp_path / f"rover/{name}.sdf", "")
    versions = {"a": "1.5", "b": "1.10", "c": "1.9", "d": "2.0"}
    manifest(tmp_path, "".join(f'<sdf version="{version}"> {name}.sdf </sdf>' for name, version in versions.items()))
    assert found(tmp_path, "model://rover") == Path("rover/b.sdf")
    # Where all are newer, the newest counts.
    manifest(tmp_path, '<sdf version="2.0">b.sdf</sdf><sdf version="2.1">a.sdf</sdf>')
    assert found(tmp_path, "rover") == Path("rover/a.sdf")


@pytest.mark.parametrize(
    ("inside", "reference", "rule", "words"),
    [
        ("", "rover", "missing-file", "has no <sdf> element"),
        ("<sdf>a.sdf</sdf>", "rover", "missing-file", "'rover/a.sdf' does not exist"),
        ("<sdf>../../a.sdf</sdf>", "model://rover", "outside-workspace", "is outside the workspace"),
        ("<sdf/>", "rover", "missing-file", "is a folder"),
        ("", "model://rovr", "missing-package", "did you mean 'rover'?"),
        ("", "rovr", "missing-package", "did you mean 'rover'?"),
        ("", "..", "outside-workspace", "is outside the workspace"),
        ("", "model:///rover", "bad-reference", "names no file"),
        ("", "a\0b", "missing-package", "was not found"),
        ("", "a" * 300 + ".sdf", "bad-reference", "is not a valid path"),
        ("", "package://rover", "missing-file", "has no <sdf> element"),
        ("", "package://rovr", "missing-package", "the package 'rovr'"),
    ],
)
def test_what_leads_nowhere_is_told(inside: str, reference: str, rule: str, words: str, tmp_path: Path) -> None:
    folder = tmp_path / "workspace"
    manifest(folder, inside)
    with pytest.raises(PackageError) as raised:
        found(folder, reference)
    assert (raised.value.rule, words in str(raised.value)) == (rule, True), raised.value


@pytest.mark.parametrize("scheme", ["model", "file"])
@pytest.mark.parametrize("name", ["part.stl", "meshes/part.stl", ".part.stl"])
def test_a_file_may_be_directly_on_the_path_for_models(tmp_path: Path, scheme: str, name: str) -> None:
    folder, inside = tmp_path / "models", tmp_path / "repository"
    written(folder / name, "")
    written(inside / "robot.urdf", "")
    packages = Packages(Workspace(inside, inside), environment={"GAZEBO_MODEL_PATH": str(folder)})
    if name.startswith("."):
        with pytest.raises(PackageError):
            packages.resolve(f"{scheme}://{name}", inside / "robot.urdf")
    else:
        assert packages.resolve(f"{scheme}://{name}", inside / "robot.urdf").path == folder / name
    packages = Packages(Workspace(tmp_path, tmp_path), environment={})
    with pytest.raises(PackageError, match=r"'model://part.stl' is in no folder for models .*GAZEBO_MODEL_PATH"):
        packages.resolve("model://part.stl", tmp_path / "robot.urdf")
