"""What an engine prints, as diagnostics."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.results.outcome import Diagnostic
from sim_action.runner.native_output import split_output

BANNER = "pybullet build time: Jan 29 2025 23:20:52\n"
WARNING = "b3Warning[examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp,126]:\nNo inertial data for link"
ERROR = "b3Error[examples/Importers/urdf.cpp,9]:\nmissing link"


@pytest.mark.parametrize(
    ("text", "diagnostics", "rest"),
    [
        ("", (), ""),
        ("hello\n", (), "hello"),
        (BANNER, (), ""),
        (f"{BANNER}hello", (), "hello"),
        (WARNING, (("warning", "No inertial data for link"),), ""),
        (
            WARNING + ERROR,
            (("warning", "No inertial data for link"), ("error", "missing link")),
            "",
        ),
        (WARNING + "\n" + WARNING, (("warning", "No inertial data for link"),), ""),
        (f"before {WARNING}\nafter\n", (("warning", "No inertial data for link"),), "before after"),
        ("b3Printf[a.cpp,1]: so it is\n", (("note", "so it is"),), ""),
        ("b3Printf[a.cpp,1]:\n\nafter", (), "after"),
        ("mujoco warning: Nan\nafter", (("warning", "Nan"),), "after"),
        (
            f"before\nmujoco warning: Nan\n{WARNING}\n",
            (("warning", "Nan"), ("warning", "No inertial data for link")),
            "before",
        ),
        ("a mujoco warning: said somebody", (), "a mujoco warning: said somebody"),
        ("b3Warning without a place", (), "b3Warning without a place"),
    ],
)
def test_messages_are_told_from_what_else_was_printed(
    text: str, diagnostics: tuple[tuple[str, str], ...], rest: str
) -> None:
    found, output = split_output(text)
    assert tuple((diagnostic.level, diagnostic.message) for diagnostic in found) == diagnostics
    assert output == rest


def test_diagnostics_have_an_end() -> None:
    found, _ = split_output("".join(f"b3Warning[a.cpp,1]:\nmessage {n}\n" for n in range(1000)))
    assert len(found) == 50
    assert found[0] == Diagnostic(level="warning", message="message 0")


@given(st.text())
def test_any_text_is_split(text: str) -> None:
    found, output = split_output(text)
    assert all(diagnostic.message for diagnostic in found)
    assert len(output) <= len(text)
