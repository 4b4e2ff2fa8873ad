"""The table of `make house` counts what it says, in a small package and in this repository."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tools import house
from tools.house import ENFORCED, LIMITS, House, Row, main, table


def package(folder: Path, **modules: str) -> House:
    """A package of these modules, whose names have `__` for a dot; `engines` and `app` are its layers from above."""
    for module, text in {"": "", "app": "", "engines": "", **modules}.items():
        path = folder / "sim_action" / module.replace("__", "/")
        is_folder = module in {"", "app", "engines"}
        path = path / "__init__.py" if is_folder else path.with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return House(folder, layers=["app", "engines | robot"])


def test_modules_with_one_importer_are_found_wherever_the_import_stands(tmp_path: Path) -> None:
    measured = package(
        tmp_path,
        app__one="from sim_action.app import two\nimport sim_action.app.three\n",
        app__two="def f() -> None:\n    from .three import x\n    from ..engines.four import y\n",
        app__three="x = 1\n",
        engines__four="y = 2\n",
    )
    assert list(measured.single_importers()) == [
        "sim_action.app.two (3 lines) <- sim_action.app.one",
        "sim_action.engines.four (1 lines) <- sim_action.app.two",
    ]


@pytest.mark.parametrize(
    ("back", "circles"),
    [
        ("from sim_action.app.one import x", 1),
        ("def f() -> None:\n    from sim_action.app.one import x", 1),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from sim_action.app.one import x", 0),
        ("x = 1", 0),
    ],
)
def test_circles_count_imports_in_functions_but_not_those_for_type_checkers(
    back: str, circles: int, tmp_path: Path
) -> None:
    measured = package(
        tmp_path,
        app__one="from sim_action.app.two import x\n",
        app__two="from sim_action.app.three import x\n",
        app__three=f"{back}\n",
    )
    expected = ["sim_action.app.one, sim_action.app.three, sim_action.app.two"]
    assert list(measured.circles()) == expected[:circles]


def test_a_module_that_imports_itself_is_listed(tmp_path: Path) -> None:
    measured = package(
        tmp_path, app__one="def f() -> None:\n    from sim_action.app.one import x\n", app__two="x = 1\n"
    )
    assert list(measured.self_imports()) == ["sim_action.app.one"]


def test_imports_that_run_upward_are_those_of_a_higher_layer_and_of_the_root(tmp_path: Path) -> None:
    measured = package(
        tmp_path,
        app__one="from sim_action.engines import two\n",
        engines__two="from sim_action.app import one\n",
        engines__three="from sim_action import x\n",
    )
    assert sorted(measured.upward_imports()) == [
        "sim_action.engines.three:1 imports sim_action",
        "sim_action.engines.two:1 imports sim_action.app.one",
    ]


@pytest.mark.parametrize(
    ("check", "good", "bad"),
    [
        ("key_comparisons", "a = part.key == name\n", 'a = part.key == "reach"\n'),
        ("key_comparisons", "a = part.kind in KINDS\n", "a = part.key in _KINDS\n"),
        ("engine_lists", 'a = ("mujoco", "other")\n', 'a = ("mujoco", "pybullet")\n'),
        ("engine_lists", 'a = {"x": "mujoco"}\n', 'a = {"mujoco": 1, "pybullet": 2}\n'),
        ("exit_code_ranks", "a = max(seeds)\n", "a = max(run.exit_code for run in runs)\n"),
        ("lazy_imports", "def f():\n    import numpy\n", "def f():\n    import statistics\n"),
        (
            "lazy_imports",
            "def f():\n    # It takes 50 ms.\n    from sim_action import engines\n",
            "def f():\n    from sim_action import engines\n",
        ),
        ("lazy_imports", "from sim_action import engines\n", "def f():\n    import json  # noqa: A001\n"),
    ],
)
def test_a_bad_line_is_found_and_a_good_one_is_not(check: str, good: str, bad: str, tmp_path: Path) -> None:
    assert list(getattr(package(tmp_path / "good", app__one=good), check)()) == []
    [place] = getattr(package(tmp_path / "bad", app__one=bad), check)()
    assert place.startswith("sim_action.app.one:")


def test_the_rooms_of_parts_and_the_table_of_engines_may_name_theirs(tmp_path: Path) -> None:
    measured = package(
        tmp_path, assertions__reach='a = self.key == "reach"\n', engines='E = {"mujoco": 1, "pybullet": 2}\n'
    )
    assert [*measured.key_comparisons(), *measured.engine_lists()] == []


def test_names_of_modules_may_be_repeated_three_times(tmp_path: Path) -> None:
    names = ("a__scene", "b__scene", "c__scene", "a__files", "b__files", "c__files", "d__files")
    assert list(package(tmp_path, **dict.fromkeys(names, "")).repeated_names()) == ["files (4 times)"]


@pytest.mark.process
def test_the_table_has_a_row_for_each_limit_and_counts_tracked_entries(tmp_path: Path) -> None:
    measured = package(tmp_path, app__one="x = 1\n" * 5)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/test_one.py").write_text("y = 2\n" * 7, encoding="utf-8")
    (tmp_path / "untracked").touch()
    for command in (["init", "--quiet"], ["add", "sim_action", "tests"]):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    rows = {row.name: row for row in measured.rows()}
    assert rows.keys() == LIMITS.keys()
    assert LIMITS.keys() >= ENFORCED
    assert rows["lines of sim_action"].value == 5
    assert rows["lines of tests above those of sim_action"].value == 2
    assert rows["entries at the root"].places == ("sim_action", "tests")


def test_a_broken_limit_is_marked_and_its_places_are_listed() -> None:
    row = Row("circles of modules", 1, ("a, b",))
    assert table([row]) == "! circles of modules                                    1 of        0"
    assert table([row], verbose=True).splitlines()[1:] == ["      a, b"]
    assert table([Row("circles of modules", 0)]).startswith("  circles")


@pytest.mark.parametrize(("limit", "code"), [(2, 0), (1, 1)])
def test_the_exit_code_says_if_an_enforced_limit_is_broken(
    limit: int, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measured = package(tmp_path, a__files="", b__files="import json\n\n\n\na = max(exit_code, 2), min(exit_code, 3)\n")
    monkeypatch.setattr(house, "House", lambda: measured)
    monkeypatch.setattr(house, "LIMITS", {"places that rank exit codes": limit})
    monkeypatch.setattr(house, "ENFORCED", frozenset({"places that rank exit codes"}))
    monkeypatch.setattr("sys.argv", ["house", "--enforced"])
    assert main() == code
    assert capsys.readouterr().out.splitlines() == [table([Row("places that rank exit codes", 2)])]
