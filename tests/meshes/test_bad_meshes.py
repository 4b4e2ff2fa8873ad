"""Mesh files that are refused: by which rule, in what words, and that nothing else can happen."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_action.meshes import MAX_TRIANGLES, MeshError, read_mesh
from sim_action.meshes.mesh import MAX_BINARY_TRIANGLES
from tests.mesh_files import CORNERS, POLYLIST, SHOWN, SIDES, SURFACE, ascii_stl, dae, obj, stl


def refusal(folder: Path, name: str, data: bytes) -> MeshError:
    with pytest.raises(MeshError) as raised:
        read_mesh(written(folder, name, data))
    return raised.value


def written(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


Row = tuple[bytes, str, str]
STL: dict[str, Row] = {
    "nothing": (b"", "broken-mesh", "0 bytes"),
    "a word": (b"hello", "broken-mesh", "only 5 bytes and does not begin with 'solid'"),
    "garbage": (bytes(range(256)), "broken-mesh", "is not an STL file, or was cut off"),
    "cut off": (stl()[:-30], "broken-mesh", "announces 12 triangles, which need 684 bytes, but it has 654"),
    "too long": (stl() + b"xx", "broken-mesh", "which need 684 bytes, but it has 686"),
    "solid cut off": (stl(header=b"solid\n")[:-30], "broken-mesh", "need 684 bytes, but it has 654"),
    "no triangle": (stl(faces=[]), "empty-mesh", "there is no triangle in it"),
    "not a number": (stl([(math.nan, 0, 0), *CORNERS[1:]]), "broken-mesh", "a coordinate that is not finite"),
    "infinite": (stl([(math.inf, 0, 0), *CORNERS[1:]]), "broken-mesh", "a coordinate that is not finite"),
    "far": (stl([(3e38, 0, 0), *CORNERS[1:]]), "broken-mesh", "beyond 1e+09"),
    "lines": (stl(faces=[(0, 0, 1), (2, 3, 2)]), "empty-mesh", "none of its triangles has an area"),
    "ASCII cut off": (ascii_stl()[:-30], "broken-mesh", "line 79: expected a whole facet or 'endsolid'"),
    "ASCII not ended": (ascii_stl().split(b"endsolid")[0], "broken-mesh", "found nothing: was the file cut off"),
    "ASCII and more": (ascii_stl() + b"more\n", "broken-mesh", "line 87: expected 'solid' or the end of"),
    "ASCII two vertices": (ascii_stl().replace(b"vertex", b"corner", 1), "broken-mesh", "line 2: expected a w"),
    "ASCII word": (ascii_stl().replace(b"-0.3", b"low", 1), "broken-mesh", "line 4: a facet has a vertex"),
    "ASCII nan": (ascii_stl().replace(b"-0.3", b"nan", 1), "broken-mesh", "line 4: a facet has a vertex"),
    "ASCII far": (ascii_stl().replace(b"-0.3", b"1e10", 1), "broken-mesh", "beyond 1e+09"),
    "ASCII empty": (b"solid a\nendsolid a\n", "empty-mesh", "there is no triangle"),
    "LFS": (b"version https://git-lfs.github.com/spec/v1\n", "broken-mesh", "git lfs pull"),
}
OBJ: dict[str, Row] = {
    "OBJ empty": (b"", "empty-mesh", "there is no triangle"),
    "OBJ points": (obj(faces=()), "empty-mesh", "there is no triangle"),
    "OBJ binary": (stl(), "broken-mesh", "NUL bytes"),
    "OBJ beyond": (
        obj(faces=[*SIDES, (0, 1, 8)]),
        "mesh-index",
        "line 15: a face refers to point 9, but there are only 8",
    ),
    "OBJ beyond 64 bits": (
        obj() + b"f 1 2 9223372036854775808\n",
        "mesh-index",
        "line 21: a face refers to point 9,223,372,036,854,775,808, but at most 1,500,000 are read",
    ),
    "OBJ beyond floats": (
        obj() + b"f 1 2 1" + b"0" * 400 + b"\n",
        "mesh-index",
        "line 21: a face refers to point 10,000,000,000,000,000,000,000..., but at most",
    ),
    "OBJ below -64 bits": (obj() + b"f 1 2 -9223372036854775809\n", "mesh-index", "line 21: a face refers"),
    "OBJ beyond digits": (obj() + b"f 1 2 1" + b"0" * 5000 + b"\n", "broken-mesh", "expected whole numbers as corners"),
    "OBJ far beyond": (obj(faces=[(0, 1, 99_999_999)]), "mesh-index", "line 9: a face refers to point 100,000,000"),
    "OBJ zero": (
        obj(faces=[(0, 1, -1)]),
        "mesh-index",
        "line 9: a face refers to point 0, but points are numbered from 1",
    ),
    "OBJ before": (obj() + b"f -1 -2 -9\n", "mesh-index", "line 21: a face refers to point -9, but there are only 8"),
    "OBJ no point": (b"f 1 2 3\n", "mesh-index", "line 1: a face refers to point 3, but there are only 0"),
    "OBJ half": (obj() + b"f 1 2.5 3\n", "broken-mesh", "line 21: 'f 1 2.5 3': expected whole numbers as corners"),
    "OBJ short": (b"v 1 2\n", "broken-mesh", "line 1: 'v 1 2': expected three finite numbers"),
    "OBJ word": (b"# box\nv 1 2 z\n", "broken-mesh", "line 2: 'v 1 2 z': expected three finite numbers"),
    "OBJ nan": (b"v 1 2 nan\n", "broken-mesh", "line 1: 'v 1 2 nan'"),
    "OBJ infinite": (b"v 1 2 1e999\n", "broken-mesh", "line 1: 'v 1 2 1e999'"),
    "OBJ goes on": (obj() + b"f 1 2 \\\n", "broken-mesh", "continuation backslash"),
    "OBJ edges": (obj(faces=[(0, 1), (2, 3)]), "empty-mesh", "there is no triangle"),
}
DAE: dict[str, Row] = {
    "DAE text": (b"hello", "broken-mesh", "line 1: is not well-formed XML: syntax error"),
    "DAE cut off": (dae()[:400], "broken-mesh", "is not well-formed XML: unclosed token"),
    "DAE other": (b"<robot/>", "broken-mesh", "line 1: is not a COLLADA file: its root element is <robot>"),
    "DAE doctype": (dae().replace(b"<COLL", b"<!DOCTYPE a>\n<COLL"), "broken-mesh", "line 2: a DOCTYPE"),
    "DAE encoding": (dae().replace(b"utf-8", b"klingon"), "broken-mesh", "line 1: "),
    "DAE beyond": (dae(SURFACE.format("0 1 8")), "mesh-index", "line 10: <triangles>: refers to point 8 (from 0)"),
    "DAE negative": (dae(SURFACE.format("0 1 -1")), "mesh-index", "line 10: <p>: expected whole numbers"),
    "DAE half": (dae(SURFACE.format("0 1 2.5")), "mesh-index", "line 10: <p>: expected whole numbers"),
    "DAE word": (dae(SURFACE.format("0 1 two")), "broken-mesh", "line 10: <p>: expected numbers"),
    "DAE odd": (dae(SURFACE.format("0 1 2 3")), "broken-mesh", "line 10: <triangles>: its <p> do not hold 1"),
    "DAE counts": (dae(POLYLIST.format("0 0").replace(">4 4", ">2000000000")), "broken-mesh", "do not hold 2"),
    "DAE empty": (dae(SURFACE.format("")), "empty-mesh", "there is no triangle"),
    "DAE not shown": (dae(node=""), "empty-mesh", "there is no triangle"),
    "DAE nan": (dae().replace(b"-0.3", b"nan", 1), "broken-mesh", "a coordinate that is not finite"),
    "DAE far": (dae(node="<scale>1e300 1 1</scale>" * 2 + SHOWN), "broken-mesh", "not finite"),
    "DAE unit": (dae(asset='<unit meter="0"/>'), "broken-mesh", "line 3: <unit>: meter='0': expected a number g"),
    "DAE unit word": (dae(asset='<unit meter="cm"/>'), "broken-mesh", "meter='cm': expected a number greater"),
    "DAE matrix": (dae(node="<matrix>1 0 0</matrix>"), "broken-mesh", "<matrix>: expected 16 numbers, found 3"),
    "DAE skew": (dae(node="<skew>1 0 0 0 1 0 0</skew>"), "broken-mesh", "<skew>: is not supported; apply it"),
    "DAE skin": (dae(node='<instance_controller url="#x"/>'), "broken-mesh", "export the surface without its skeleton"),
    "DAE elsewhere": (dae(node='<instance_geometry url="b.dae#box"/>'), "broken-mesh", "the file has no <geometry>"),
    "DAE unknown": (dae(node='<instance_geometry url="#x"/>'), "broken-mesh", "url='#x': the file has no <geometry>"),
    "DAE of itself": (dae(node='<instance_node url="#shown"/>'), "broken-mesh", "more than 100 nested nodes"),
    "DAE no source": (dae().replace(b"POSITION", b"NORMAL"), "broken-mesh", 'no <input semantic="POSITION">'),
    "DAE no vertices": (dae().replace(b"VERTEX", b"COLOR"), "broken-mesh", 'no <input semantic="VERTEX">'),
    "DAE stride": (dae().replace(b'stride="3"', b'stride="2"'), "broken-mesh", "a point has three coordinates"),
    "DAE offset": (dae().replace(b'offset="0"', b'offset="-1"'), "broken-mesh", "expected a whole number from 0"),
    "DAE offsets": (dae().replace(b'offset="0"', b'offset="9999"'), "broken-mesh", "more than 64 inputs"),
}
BAD: dict[str, tuple[str, bytes, str, str]] = {
    **{title: ("a.stl", *row) for title, row in STL.items()},
    **{title: ("a.obj", *row) for title, row in OBJ.items()},
    **{title: ("a.dae", *row) for title, row in DAE.items()},
    "PLY": (
        "a.ply",
        b"ply\n",
        "unknown-mesh-format",
        "'.ply' files are not supported; convert it to one of .stl, .obj, .dae",
    ),
    "GLB": ("a.glb", b"glTF", "unknown-mesh-format", "'.glb' files are not supported"),
    "no name": ("mesh", stl(), "unknown-mesh-format", "'' files are not supported"),
}
"""Title -> file, content, rule, and words of the message."""


@pytest.mark.parametrize(("name", "data", "rule", "message"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_said(name: str, data: bytes, rule: str, message: str, tmp_path: Path) -> None:
    error = refusal(tmp_path, name, data)
    assert error.rule == rule
    assert message in str(error)
    assert str(error) == (f"line {error.line}: {error.message}" if error.line else error.message)


def test_a_mesh_that_is_not_there_is_missing(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="does not exist") as raised:
        read_mesh(tmp_path / "a.stl")
    assert raised.value.rule == "missing-mesh"


def test_what_is_no_file_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "folder.stl").mkdir()
    for name in ("pipe.stl", "folder.stl", "nul\0.stl"):
        with pytest.raises(MeshError, match="cannot be read") as raised:
            read_mesh(tmp_path / name)
        assert raised.value.rule == "broken-mesh"


HEADER = b" " * 80
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"

LARGE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "STL triangles": (
        "a.stl",
        lambda: HEADER + struct.pack("<I", MAX_BINARY_TRIANGLES + 1) + bytes(50 * (MAX_BINARY_TRIANGLES + 1)),
        "has 2,100,001 triangles or more; at most 2,100,000 are read",
    ),
    "ASCII solids": ("a.stl", lambda: b"solid\nendsolid\n" * 10_001, "10,001 parts"),
    "OBJ triangles": (
        "a.obj",
        lambda: TRIANGLE + b"f" + b" 1" * 499_000 + b"\nf" + b" 1" * 499_000,
        "997,996 triangles",
    ),
    "OBJ points": ("a.obj", lambda: b"v 0 0 0\n" * 1_500_001, "1,500,001 points"),
    "OBJ objects": ("a.obj", lambda: TRIANGLE + b"o a\nf 1 2 3\n" * 10_001, "10,001 parts"),
    "OBJ lines": ("a.obj", lambda: b"\n" * 5_000_001, "more than 5,000,000 lines"),
    "OBJ one line": (
        "a.obj",
        lambda: b"v " + b"1" * 1_000_000,
        "line 1: a statement of more than 1,000,000 characters",
    ),
    "OBJ continued": ("a.obj", lambda: b"v" + b" 1 \\\n" * 1_000_002, "a statement of more than 1,000,000 characters"),
    "DAE elements": ("a.dae", lambda: b"<COLLADA>" + b"<a/>" * 200_001, "more than 200,000 elements"),
    "DAE attributes": ("a.dae", lambda: b"<COLLADA " + b'a="" ' * 1_000_001, "more than 1,000,000 attributes"),
    "DAE triangles": ("a.dae", lambda: dae(SURFACE.format("0 1 2 " * (MAX_TRIANGLES + 1))), "500,001 triangles"),
    "DAE instances": ("a.dae", lambda: dae(SURFACE.format("0 1 2 " * 100), SHOWN * 5_001), "500,100 triangles"),
    "DAE parts": ("a.dae", lambda: dae(SURFACE.format("0 1 2"), SHOWN * 10_001), "10,001 parts"),
    "DAE nodes": ("a.dae", lambda: dae(node=("<node><node/></node>" * 10_001)), "more than 20,000 nodes"),
}


@pytest.mark.parametrize(("name", "made", "message"), LARGE.values(), ids=LARGE)
def test_what_is_too_large_is_refused_as_that(
    name: str, made: Callable[[], bytes], message: str, tmp_path: Path
) -> None:
    error = refusal(tmp_path, name, made())
    assert error.rule == "too-large-mesh"
    assert message in str(error)


def test_no_more_of_a_file_is_read_than_may_be(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.touch()
    os.truncate(path, 2**40)  # it takes no room on the disk, and would take it in memory
    with pytest.raises(MeshError, match="is larger than 110 MB"):
        read_mesh(path)


def test_nodes_that_use_each_other_do_not_multiply(tmp_path: Path) -> None:
    nodes = "".join(f'<node id="n{n}">{f"""<instance_node url="#n{n + 1}"/>""" * 9}</node>' for n in range(20))
    error = refusal(tmp_path, "a.dae", dae(node=f'{nodes}<node id="n20"/>'))
    assert (error.rule, "20,000 nodes" in str(error)) == ("too-large-mesh", True)


def test_nothing_deep_ends_the_process(tmp_path: Path) -> None:
    error = refusal(tmp_path, "a.dae", b"<COLLADA>" + b"<a>" * 100_000)
    assert (error.rule, str(error)) == ("broken-mesh", "line 1: more than 200 nested elements")
