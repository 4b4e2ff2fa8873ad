"""Programs that stand in texts of the tests import modules that exist: no tool that moves a module sees them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
IMPORT = re.compile(r"^from ((?:sim_action|tests|tools|action)(?:\.\w+)*) import (\w+)", re.MULTILINE)
FILES = [*ROOT.glob("tests/**/*.py"), *ROOT.glob("examples/**/*.py")]


def exists(module: str, name: str) -> bool:
    """Return True if there is such a module, or such a name in the text of its package."""
    path = ROOT / module.replace(".", "/")
    package = path / "__init__.py"
    file = package if package.is_file() else path.with_suffix(".py")
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    is_module = (path / f"{name}.py").is_file() or (path / name / "__init__.py").is_file()
    return is_module or re.search(rf"\b{name}\b", text) is not None


def test_every_import_names_a_module() -> None:
    missing = {
        file.relative_to(ROOT).as_posix(): names
        for file in FILES
        if (names := [name for name in IMPORT.findall(file.read_text(encoding="utf-8")) if not exists(*name)])
    }
    assert missing == {}
