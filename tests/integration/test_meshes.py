"""What PyBullet does with the meshes of strangers, and what it does once they are rewritten, beside what is right."""

from __future__ import annotations

import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sim_action.meshes import MeshError
from tests import mesh_files
from tests.integration.mesh_trials import ENGINES_MARGIN, both, found, reach, rewritten, written
from tests.mesh_files import GOOD, HALF, SHOWN, SIDES, ascii_stl, dae, obj, stl, two_instances, two_objects, wheel

pytestmark = pytest.mark.pybullet
MATRIX = "<matrix>1 0 0 1  0 1 0 2  0 0 1 3  0 0 0 1</matrix>"
POLYLIST = '<polylist><input semantic="VERTEX" source="#vertices" offset="0"/><vcount>{}</vcount><p>{}</p></polylist>'
DAE_OF_SIDES = dae(POLYLIST.format("4 " * 6, " ".join(str(row) for side in SIDES for row in side)))
GON, GON_SIDES = wheel(1.0, 0.2, 400)  # its second half is beyond the 1,024 characters that the engine reads of a line


BOX = both((-0.1, -0.2, -0.3), HALF)
TWO = both((-0.1, -0.2, -0.3), (1.1, 0.2, 0.3))
MOVED = both((0.9, 1.8, 2.7), (1.1, 2.2, 3.3))
CUT = both((0, -0.2, -0.3), HALF)
NOTHING = (None,) * 6

UNDERSTOOD: dict[str, tuple[str, bytes, tuple[float, ...]]] = {
    "binary STL": ("a.stl", stl(), BOX),
    "binary STL that says solid": ("a.stl", stl(header=b"solid box\n"), BOX),
    "upper case": ("A.STL", stl(), BOX),
    "OBJ": ("a.obj", obj(), BOX),
    "OBJ of quads": ("a.obj", obj(faces=SIDES), BOX),
    "OBJ counted backwards": ("a.obj", obj(corner=lambda row: str(row - 8)), BOX),
    "OBJ with coordinates of textures": ("a.obj", obj(before="vt 0 0\n", corner=lambda row: f"{row + 1}/1"), BOX),
    "OBJ with a missing material": ("a.obj", obj(before="mtllib no.mtl\nusemtl a\n"), BOX),
    "OBJ with a file for a material": ("a.obj", obj(before="mtllib /etc/passwd\nusemtl a\n"), BOX),
    "OBJ of two": ("a.obj", two_objects(), TWO),
    "DAE": ("a.dae", dae(), BOX),
    "DAE in dm": ("a.dae", dae(asset='<unit meter="0.1"/>'), tuple(part / 10 for part in BOX)),
    "DAE with y up": ("a.dae", dae(asset="<up_axis>Y_UP</up_axis>"), BOX),
    "DAE moved": ("a.dae", dae(node=MATRIX + SHOWN), MOVED),
    "DAE moved in dm": ("a.dae", dae(node=MATRIX + SHOWN, asset='<unit meter="0.1"/>'), tuple(p / 10 for p in MOVED)),
    "DAE of polygons": ("a.dae", DAE_OF_SIDES, BOX),
    "DAE of two": ("a.dae", two_instances(), TWO),
}
"""What the engine reads, and so do we: how far it reaches, in m."""

MISREAD: dict[str, tuple[str, bytes, tuple[float | None, ...], tuple[float, ...]]] = {
    "ASCII STL": ("a.stl", ascii_stl(), NOTHING, BOX),
    "OBJ with long lines": (
        "a.obj",
        obj(GON, GON_SIDES[-2:]),
        both((-1, -0.9556, -0.1), (1, 1, 0.1)),
        both((-1, -1, -0.1), (1, 1, 0.1)),
    ),
    "OBJ of continued lines": ("a.obj", obj().replace(b"v -0.1 ", b"v \\\n-0.1 "), CUT, BOX),
    "DAE of <polygons>": ("a.dae", GOOD["polygons.dae"], NOTHING, BOX),
    "DAE of <tristrips>": ("a.dae", GOOD["strips.dae"], NOTHING, BOX),
    "DAE without a scene": ("a.dae", dae()[: dae().index(b"<library_visual")] + b"</COLLADA>", NOTHING, BOX),
    "DAE moved twice": ("a.dae", dae(node=MATRIX * 2 + SHOWN), MOVED, both((1.9, 3.8, 5.7), (2.1, 4.2, 6.3))),
    "DAE scaled, then moved": (
        "a.dae",
        dae(node="<scale>2 1 1</scale><translate>1 2 3</translate>" + SHOWN),
        both((0.8, 1.8, 2.7), (1.2, 2.2, 3.3)),
        both((1.8, 1.8, 2.7), (2.2, 2.2, 3.3)),
    ),
}
"""What the engine takes for something else without an error, and what it is."""


def each_written(folder: Path, cases: Mapping[str, tuple[Any, ...]]) -> dict[str, Path]:
    paths = {}
    for number, (case, (name, data, *_)) in enumerate(cases.items()):
        (folder / str(number)).mkdir()
        paths[case] = written(folder / str(number), name, data)
    return paths


def alone_and_rewritten(folder: Path, cases: Mapping[str, tuple[Any, ...]]) -> dict[str, list[dict[str, Any]]]:
    """What one process of the engine says of the file of each case, and of the file that we make of it."""
    paths = each_written(folder, cases)
    answers = iter(found(*(["look_at", shape] for path in paths.values() for shape in (str(path), rewritten(path)))))
    return {case: [next(answers), next(answers)] for case in paths}


def test_what_the_engine_understands_stays_what_it_is(tmp_path: Path) -> None:
    for case, (alone, helped) in alone_and_rewritten(tmp_path, UNDERSTOOD).items():
        expected = UNDERSTOOD[case][2]
        assert reach(alone) == pytest.approx([part + ENGINES_MARGIN for part in expected], abs=1e-5), case
        assert reach(helped) == pytest.approx(expected, abs=1e-5), case


def test_what_the_engine_misreads_is_right_once_rewritten(tmp_path: Path) -> None:
    for case, (alone, helped) in alone_and_rewritten(tmp_path, MISREAD).items():
        _, _, misread, expected = MISREAD[case]
        taken_for = [part if part is None else part + ENGINES_MARGIN for part in misread]
        assert reach(alone) == (NOTHING if misread == NOTHING else pytest.approx(taken_for, abs=1e-3)), case
        assert reach(helped) == pytest.approx(expected, abs=1e-4), case


def test_whatever_is_rewritten_does_the_engine_no_harm(tmp_path: Path) -> None:
    chance = random.Random(20)
    good = [
        ("a.stl", stl()),
        ("a.stl", ascii_stl()),
        ("a.obj", two_objects()),
        ("a.dae", dae()),
        ("a.dae", DAE_OF_SIDES),
    ]
    kept = 0
    for _ in range(600):
        name, data = chance.choice(good)
        changed = bytearray(data)
        for _ in range(chance.randint(1, 3)):
            changed[chance.randrange(len(changed))] = chance.choice(b"0123456789-. e/\n<" + chance.randbytes(4))
        try:
            rewritten(written(tmp_path, name, bytes(changed)))
            kept += 1
        except MeshError:
            pass
    assert kept > 100
    assert found(["survive", str(tmp_path / "rewritten")]) == [{"lost": 0}]


def test_a_scale_acts_as_it_does_in_the_engine(tmp_path: Path) -> None:
    path = written(tmp_path, "L.stl", stl(mesh_files.L_POINTS, mesh_files.L_FACES))
    scales = [(2, 1, 0.5), (-1, 1, 1), (-1, -2, -0.1)]
    shapes = [[str(path), "", " ".join(map(str, scale))] for scale in scales]
    shapes += [[rewritten(path, scale)] for scale in scales]
    reaches = [reach(answer) for answer in found(*(["look_at", *shape] for shape in shapes))]
    for alone, helped in zip(reaches[:3], reaches[3:], strict=True):
        assert [part - ENGINES_MARGIN for part in alone] == pytest.approx(helped, abs=1e-5)


def test_a_box_stands_at_its_height_and_weighs_what_is_stated(tmp_path: Path) -> None:
    files = {"a.stl": stl(), "a.obj": obj(), "a.dae": dae(), "b.stl": ascii_stl()}
    paths = [written(tmp_path, name, data) for name, data in files.items()]
    shapes = [*map(rewritten, paths), rewritten(paths[0], margin=0)]
    *drawn_in, as_it_is = found(*(["look_at", shape] for shape in shapes))
    assert [answer["rests_at"] for answer in drawn_in] == pytest.approx([0.3] * 4, abs=5e-5)
    assert [answer["mass"] for answer in drawn_in] == [2] * 4
    assert as_it_is["rests_at"] == pytest.approx(0.3 + ENGINES_MARGIN, abs=5e-5)
