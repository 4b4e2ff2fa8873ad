from __future__ import annotations

import base64
import hashlib
import re

from sim_action.reports.page.document import SCRIPTS, Page, page_script, policy
from sim_action.reports.page.markup import Html


def fingerprint(content: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}"


def text() -> str:
    return Page(
        "title </title><script>", failed=True, body=Html("<main></main>"), index="{}", blocks={"a": "QQ=="}
    ).text()


def test_what_runs_and_what_styles_is_allowed_by_its_hash() -> None:
    [script] = re.findall(r"<script>(.*?)</script>", text(), re.DOTALL)
    [style] = re.findall(r"<style>(.*?)</style>", text(), re.DOTALL)
    allowed = re.findall(r"sha256-[A-Za-z0-9+/=]+", text())
    assert {fingerprint(script), fingerprint(style)} <= set(allowed)


def test_nothing_else_may_be_done() -> None:
    told = policy("'sha256-a'", ["'sha256-b'"])
    assert told.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in told
    assert told.count("sha256-") == 2


def test_a_title_is_text() -> None:
    assert "<title>title &lt;/title&gt;&lt;script&gt;</title>" in text()


def test_the_script_is_made_of_all_its_parts_and_ends_no_element() -> None:
    assert "</script" not in page_script().lower()
    assert "<!--" not in page_script()
    assert len(set(SCRIPTS)) == len(SCRIPTS)


def test_every_script_beside_the_page_is_in_it() -> None:
    from importlib.resources import files

    beside = {file.name for file in (files("sim_action.reports") / "viewer").iterdir() if file.name.endswith(".js")}
    assert beside == set(SCRIPTS)
