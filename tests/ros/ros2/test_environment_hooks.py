"""The variables that setup.bash would set, without a shell."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros2.environment_hooks import packages_of_prefix, set_up
from tests.ros.ros2.prefixes import installed
from tests.ros_workspace import written


def test_variables_are_extended_once(tmp_path: Path) -> None:
    installed(
        tmp_path,
        "p",
        "# a comment\n"
        "prepend-non-duplicate;A;one;two\n"
        "prepend-non-duplicate;A;one\n"
        "append-non-duplicate;A;last\n"
        "append-non-duplicate;A;last\n"
        "prepend-non-duplicate-if-exists;A;absent\n"
        "prepend-non-duplicate-if-exists;A;share\n"
        "prepend-non-duplicate;A;/absolute\n"
        "no semicolon\n"
        "unknown;A;b\n",
    )
    found = set_up([tmp_path], {"A": "before", "B": "other"}).variables

    a = ["/absolute", f"{tmp_path}/share", f"{tmp_path}/two", f"{tmp_path}/one", "before", f"{tmp_path}/last"]
    assert found == {"A": ":".join(a), "AMENT_PREFIX_PATH": str(tmp_path)}


def test_variables_are_set(tmp_path: Path) -> None:
    installed(tmp_path, "p", "set;A;share\nset;B;text;more\nset-if-unset;C;new\nset-if-unset;D;new\nset;E;\n")
    found = set_up([tmp_path], {"A": "old", "C": "old"}).variables

    assert (found["A"], found["B"], found["D"]) == (f"{tmp_path}/share", "text;more", "new")
    assert "C" not in found


def test_hooks_of_hooks_are_read_and_scripts_alone_are_named(tmp_path: Path) -> None:
    hook = "source;share/p/hook/path"
    installed(tmp_path, "p", f"{hook}.sh\n{hook}.ps1\nsource;share/p/own.bash\nsource;share/p/own.ps1\n")
    written(tmp_path / "share/p/hook/path.dsv", "prepend-non-duplicate;PYTHONPATH;lib/python\n")
    found = set_up([tmp_path], {})

    assert found.variables["PYTHONPATH"] == f"{tmp_path}/lib/python"
    assert found.unread == (f"{tmp_path}/share/p/own.bash",)


def test_hooks_that_read_each_other_come_to_an_end(tmp_path: Path) -> None:
    installed(tmp_path, "p", "source;share/p/package.sh\nset;A;1\n")

    assert set_up([tmp_path], {}).variables["A"] == "1"


def test_the_first_prefix_wins(tmp_path: Path) -> None:
    first = installed(tmp_path / "first", "p", "prepend-non-duplicate;A;lib\n")
    second = installed(tmp_path / "second", "q", "prepend-non-duplicate;A;lib\n")
    found = set_up([first, second], {}).variables

    assert found == {"A": f"{first}/lib:{second}/lib", "AMENT_PREFIX_PATH": f"{first}:{second}"}


def test_a_package_comes_after_its_dependencies(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        installed(tmp_path, name)
    written(tmp_path / "share/colcon-core/packages/a", "b:unknown")
    written(tmp_path / "share/ament_index/resource_index/package_run_dependencies/b", "c;b")

    assert packages_of_prefix(tmp_path) == ["c", "b", "a"]


def test_a_circle_of_dependencies_is_in_the_order_of_the_alphabet(tmp_path: Path) -> None:
    for name, other in (("b", "a"), ("a", "b")):
        installed(tmp_path, name)
        written(tmp_path / "share/colcon-core/packages" / name, other)

    assert packages_of_prefix(tmp_path) == ["a", "b"]


def test_a_missing_prefix_changes_its_own_variable_alone(tmp_path: Path) -> None:
    assert set_up([tmp_path / "absent"], {}).variables == {"AMENT_PREFIX_PATH": f"{tmp_path}/absent"}
