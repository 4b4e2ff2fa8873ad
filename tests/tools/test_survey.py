"""The survey of the models below a folder."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.ros_workspace import NAMESPACE, TRIANGLE, written
from tools.docs.survey import Collection, Survey, row, share, survey, surveyed

_INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
_LINK = f'<link name="base">{_INERTIAL}%s</link>'
_MESH = '<visual><geometry><mesh filename="%s"/></geometry></visual>'
_MJCF = '<mujoco><worldbody><body name="base"><geom size="1"/></body></worldbody></mujoco>'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A collection with an arm without package.xml, and files that are no models."""
    root = tmp_path.resolve() / "collection"
    written(root / "arm/meshes/base.stl", TRIANGLE)
    written(
        root / "arm/urdf/arm.urdf", f"<robot name='arm'>{_LINK % (_MESH % 'package://arm/meshes/base.stl')}</robot>"
    )
    written(root / "arm/urdf/bare.urdf", f"<robot name='bare'>{_LINK % (_MESH % 'package://arm/meshes/b.stl')}</robot>")
    written(root / "arm/urdf/none.urdf", "<robot name='none'/>")
    written(root / "cart/macros.xacro", f'<robot name="macros" {NAMESPACE}/>')
    include = '<xacro:include filename="macros.xacro"/>'
    written(root / "cart/cart.xacro", f'<robot name="cart" {NAMESPACE}>{include}{_LINK % ""}</robot>')
    written(root / "cart/negative.urdf", f"<robot name='n'>{(_LINK % '').replace('2', '-2')}</robot>")
    written(root / "hopper/hopper.xml", _MJCF)
    written(root / "hopper/scene.xml", '<mujoco><include file="hopper.xml"/></mujoco>')
    written(root / "hopper/package.xml", "<package/>")
    written(
        root / "box/model.config", '<model><sdf version="1.9">new.sdf</sdf><sdf version="1.4">old.sdf</sdf></model>'
    )
    for name in ("new", "old"):
        written(root / f"box/{name}.sdf", '<sdf version="1.9"><model name="box"><link name="base"/></model></sdf>')
    return root


def test_models_are_files_with_a_robot(folder: Path) -> None:
    found = [str(path.relative_to(folder)) for path in Collection(folder).models]
    assert found == [
        "arm/urdf/arm.urdf",
        "arm/urdf/bare.urdf",
        "box/new.sdf",
        "cart/cart.xacro",
        "cart/negative.urdf",
        "hopper/hopper.xml",
    ]
    assert Collection(folder, frozenset({"arm", "cart"})).models == (
        folder / "box/new.sdf",
        folder / "hopper/hopper.xml",
    )


def test_a_model_loads_with_its_notes(folder: Path) -> None:
    found = survey("arm/urdf/arm.urdf", folder)
    assert (found.loads, found.mass, found.needs) == (True, 2.0, ())
    assert found.notes["package-folder"] == 1
    assert row(found, "arm")[:4] == ("arm", "yes", "2 kg", "none")
    assert survey("cart/cart.xacro", folder).loads


def test_a_refused_model_has_its_rules(folder: Path) -> None:
    found = survey("cart/negative.urdf", folder)
    assert (found.loads, found.mass) == (False, None)
    assert [rule for rule, _ in found.reasons] == ["negative-mass"]
    assert row(found, "n")[1] == "no: `negative-mass`"


def test_a_model_whose_file_is_nowhere_is_not_complete(folder: Path) -> None:
    collection = Collection(folder)
    absent = survey("arm/urdf/bare.urdf", folder).absent
    assert absent == (("package://arm/meshes/b.stl", str(folder / "arm/meshes/b.stl")),)
    assert list(collection.lacks(absent)) == ["package://arm/meshes/b.stl"]
    assert not list(collection.lacks([("package://ARM/meshes/Base.STL", ""), ("hopper", "")]))


def test_the_text_of_a_model_names_its_files(folder: Path) -> None:
    path = folder / "arm/urdf/arm.urdf"
    names = ["package://arm/meshes/base.stl", "../meshes/base.stl", "$(find arm)/urdf/arm.urdf", "${a}.stl", "lib.so"]
    absent = ["package://hand/meshes/base.stl", "../base.stl", "$(find arm)/urdf/hand.urdf"]
    text = "".join(f'<mesh filename="{name}"/>' for name in (*names, *absent))
    assert list(Collection(folder).missing(path, text)) == absent


def test_the_share_is_that_of_complete_models() -> None:
    good = Survey("a", loads=True)
    results = [good, good, Survey("b"), Survey("c", is_complete=False), replace(good, is_part=True)]
    assert share(results) == ("4", "2", "3", "2 (66.7 %)")
    assert share([]) == ("0", "0", "0", "0")


@pytest.mark.process
def test_each_model_is_read_in_a_process_of_its_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    models = (folder / "arm/urdf/arm.urdf", folder / "arm/urdf/bare.urdf")
    monkeypatch.setattr(Collection, "models", models)
    found, bare = surveyed(folder, time_limit_s=60.0)
    assert (found.loads, found.is_complete, bare.is_complete) == (True, True, False)
    monkeypatch.setattr("tools.docs.survey.survey", exit_hard)
    assert [rule for each in surveyed(folder) for rule, _ in each.reasons] == ["crash", "crash"]


def exit_hard(*_: object) -> None:
    """End the process as a crash does."""
    os._exit(1)
