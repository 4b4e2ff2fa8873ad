"""Meshes of a model as the audit tells of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action import meshes
from sim_action.core.errors import RefusedModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.ros_workspace import written

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CUBE = SQUARE + SQUARE.replace(" 0\n", " 1\n") + "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"


def model(folder: Path, name: str, text: str, scale: str = "") -> Path:
    (folder / name).write_text(text)
    mesh = f'<mesh filename="{name}"{scale}/>'
    return written(folder / "robot.urdf", GOOD.replace('<sphere radius="0.5"/>', mesh))


@pytest.mark.parametrize(
    ("name", "text", "rule", "message"),
    [
        ("part.ply", "ply", "unknown-mesh-format", "mesh 'part.ply': "),
        ("part.stl", "garbage", "broken-mesh", "mesh 'part.stl': "),
        ("part.stl", "solid a\nendsolid a\n", "empty-mesh", "there is no triangle in it"),
        ("part.obj", f"{SQUARE}f 1 2 9\n", "mesh-index", "line 5"),
        ("part.obj", "version https://git-lfs.github.com/spec/v1\n", "broken-mesh", "git lfs pull"),
    ],
)
def test_a_mesh_is_refused_on_the_line_that_names_it(
    name: str, text: str, rule: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(RefusedModel) as refused:
        read_urdf(model(tmp_path, name, text))
    (problem,) = refused.value.problems
    assert problem.location.line == 10
    assert message in problem.message
    assert problem.message.endswith(f"[{rule}]")


@pytest.mark.parametrize("scale", ["-", "1 1", "1 1 x", "nan nan nan", "1e999 1 1", "ä" * 700, "1_0 1 1"])
@pytest.mark.parametrize("tag", ["visual", "collision"])
def test_a_scale_that_is_no_three_numbers_is_refused_on_its_line(tag: str, scale: str, tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text(CUBE)
    mesh = f'<{tag}><geometry><mesh filename="part.obj" scale="{scale}"/></geometry></{tag}>'
    path = written(tmp_path / "robot.urdf", GOOD.replace("</link>", f"\n{mesh}</link>", 1))
    line = path.read_text().partition("scale=")[0].count("\n") + 1
    with pytest.raises(RefusedModel) as refused:
        read_urdf(path)
    (problem,) = refused.value.problems
    assert problem.location.line == line
    assert "scale" in problem.message


def test_a_good_mesh_is_rewritten_in_metres(tmp_path: Path) -> None:
    urdf = read_urdf(model(tmp_path, "part.obj", CUBE, ' scale="0.001 0.001 0.001"')).urdf
    assert "scale" not in urdf
    assert "part.obj" not in urdf


def test_what_is_not_convex_is_told(tmp_path: Path) -> None:
    dented = CUBE.replace("f 5 6 7 8\n", "v 0.5 0.5 0.2\nf 5 6 9\nf 6 7 9\nf 7 8 9\nf 8 5 9\n")
    texts = (CUBE, dented, f"{SQUARE}f 1 2 3 4\n")
    rules = [[found.rule for found in read_urdf(model(tmp_path, "part.obj", text)).findings] for text in texts]
    assert rules == [[], ["concave-mesh"], ["flat-mesh"]]


@pytest.mark.parametrize(
    ("scale", "lower", "upper"),
    [
        ("", (0, 0, 0), (1, 1, 1)),
        (' scale="2 1 0.5"', (0, 0, 0), (2, 1, 0.5)),
        (' scale="-1 -2 3"', (-1, -2, 0), (0, 0, 3)),
    ],
)
def test_a_mesh_is_as_large_as_its_scale_makes_it(
    scale: str, lower: tuple[float, ...], upper: tuple[float, ...], tmp_path: Path
) -> None:
    (shape,) = read_urdf(model(tmp_path, "part.obj", CUBE, scale)).links[0].collisions
    assert (shape.lower_xyz, shape.upper_xyz) == (lower, upper)


def test_the_size_of_a_mesh_that_is_known_costs_no_second_look_at_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = model(tmp_path, "part.obj", CUBE, ' scale="-1 2 0.5"')
    first = read_urdf(path)
    monkeypatch.setattr(meshes, "READERS", {"obj": None})
    assert read_urdf(path).links == first.links
    (tmp_path / "part.obj").write_text(CUBE + "# changed\n")
    with pytest.raises(TypeError):
        read_urdf(path)


@pytest.mark.parametrize(
    ("scale", "rule", "message"),
    [
        ("100 100 100", "absurd-size", 'is 100 m large: if it is in millimetres, write scale="0.1 0.1 0.1"'),
        ("-1 -51 1", "absurd-size", 'is 51 m large: if it is in millimetres, write scale="-0.001 -0.051 0.001"'),
        (
            "1e-4 2e-4 1e-4",
            "tiny-mesh",
            'is only 0.0002 m large: if it is already in metres, write scale="0.1 0.2 0.1"',
        ),
    ],
)
def test_millimetres_that_were_taken_for_metres_are_told_where_the_mesh_is_named(
    scale: str, rule: str, message: str, tmp_path: Path
) -> None:
    path = model(tmp_path, "part.obj", CUBE, f' scale="{scale}"')
    # Its mass is none of such a size, either.
    (found,) = (found for found in read_urdf(path, allow=["absurd-size"]).findings if found.rule == rule)
    assert found.location.line == 10
    assert found.message == f"mesh 'part.obj' {message}"


def test_a_part_as_long_as_a_house_is_not_absurd(tmp_path: Path) -> None:
    scales = ("50 50 50", "0.001 0.001 0.001")
    models = [read_urdf(model(tmp_path, "part.obj", CUBE, f' scale="{scale}"')) for scale in scales]
    rules = [finding.rule for model in models for finding in model.findings]
    assert rules == ["odd-mass"]
