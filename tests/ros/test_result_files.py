"""Result files of tests, complete and damaged."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.result_files import Case, Suite, read_suite

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'
PASSED = f"""{HEAD}<testsuite errors="0" failures="0" name="x" tests="1" time="1">
<testcase classname="__main__.T" name="test_a" time="1" /><system-out>&lt;![CDATA[
said 1 &amp;lt; 2

]]&gt;</system-out><system-err>&lt;![CDATA[

]]&gt;</system-err></testsuite>"""
FAILED = f"""{HEAD}<testsuite><testcase name="test_b"><failure type="AssertionError">0 != 1
  File "t.py", line 3, in test_b
</failure></testcase><testcase name="test_c"><error type="E" message="none" /></testcase></testsuite>"""


def read(folder: Path, text: str) -> Suite | None:
    path = folder / "rosunit-x.xml"
    path.write_text(text, encoding="utf-8")
    return read_suite(path)


def test_cases_have_what_they_printed_and_how_they_failed_or_were_skipped(tmp_path: Path) -> None:
    assert read(tmp_path, PASSED) == Suite((Case("test_a"),), "said 1 &lt; 2")
    assert read(tmp_path, FAILED) == Suite(
        (
            Case("test_b", "failure", "AssertionError", '0 != 1\n  File "t.py", line 3, in test_b\n'),
            Case("test_c", "error", "E", "none"),
        )
    )
    skipped = '<testcase name="test_d"><skipped type="pytest.skip" message="no lidar" /></testcase>'
    disabled = '<testcase name="DISABLED_e" status="notrun" result="suppressed" time="0" />'
    assert read(tmp_path, f"{HEAD}<testsuite>{skipped}{disabled}</testsuite>") == Suite(
        (Case("test_d", "skipped", "pytest.skip", "no lidar"), Case("DISABLED_e", "skipped", "", "it is disabled"))
    )


def test_a_head_alone_is_nothing(tmp_path: Path) -> None:
    """What a test leaves that was ended by a limit."""
    assert read(tmp_path, HEAD) is None
    assert read(tmp_path, "") is None
    assert read_suite(tmp_path / "nowhere.xml") is None


def test_what_xml_forbids_is_left_out(tmp_path: Path) -> None:
    found = read(tmp_path, FAILED.replace("0 != 1", "0 \x1b[31m&#x1b; &#27; != \x00 1"))
    assert found is not None
    assert found.cases[0].text.startswith("0 [31m  !=  1\n")


def test_entities_are_not_made(tmp_path: Path) -> None:
    assert read(tmp_path, '<!DOCTYPE t [<!ENTITY a "b">]><testsuite><testcase name="&a;"/></testsuite>') is None


@given(st.binary(max_size=300))
def test_no_file_breaks_it(data: bytes) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.xml"
        path.write_bytes(b"<testsuite><testcase name='a'>" + data + b"</testcase></testsuite>")
        found = read_suite(path)
    assert found is None or found.cases
