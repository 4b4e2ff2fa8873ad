"""The table of `make house` counts what it says, in a small package and in this repository."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.house import House


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
def test_circles_count_imports_in_functions_but_not_for_type_checkers(back: str, circles: int, tmp_path: Path) -> None:
    measured = package(
        tmp_path,
        app__one="from sim_action.app.two import x\n",
        app__two="from sim_action.app.three import x\n",
        app__three=f"{back}\n",
    )
    expected = ["sim_action.app.one, sim_action.app.three, sim_action.app.two"]
    assert list(measured.circles()) == expected[:circles]


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
