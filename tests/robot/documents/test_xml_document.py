"""What is said of text that is no XML."""

from __future__ import annotations

from xml.parsers import expat

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.robot.documents.xml_document import explain_xml_error, parse_document


def said(data: bytes) -> str:
    with pytest.raises(expat.ExpatError) as raised:
        expat.ParserCreate().Parse(data, True)
    return explain_xml_error(raised.value, data).removeprefix("not well-formed XML: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<a>\n<b>\n<c/></a>", "mismatched tag: found </a>, expected the end of <b> from line 2"),
        ("<a><b></b></c ></a>", "mismatched tag: found </c>, expected the end of <a> from line 1"),
        ("<a></aa>", "mismatched tag: found </aa>, expected the end of <a> from line 1"),
        ("<a>&auml;</a>", "undefined entity; write a literal & as &amp;"),
        ('<a b="1 < 2"/>', "not well-formed (invalid token); write a literal < as &lt;"),
        ("<a>\n<<<<<<< HEAD\n</a>", "not well-formed (invalid token); resolve the conflict that a merge left here"),
        ("name: a\n", "syntax error; a model is a .urdf, .xacro or .sdf file, or an .xml file for MuJoCo"),
        ("solid a\n", "syntax error; a model is a .urdf, .xacro or .sdf file, or an .xml file for MuJoCo"),
        ("", "no element found"),
    ],
)
def test_what_to_mend_is_said(text: str, message: str) -> None:
    assert said(text.encode()) == message


@pytest.mark.parametrize(
    ("before", "encoding"), [("\n", ""), ("<!-- \xfc -->\n ", ' encoding="utf-8"'), ("\n", ' encoding = "latin-1"')]
)
def test_a_declaration_that_is_not_the_first_counts_and_lines_are_those_of_the_file(before: str, encoding: str) -> None:
    data = f'{before}<?xml version="1.0"\n{encoding}?>\n<a>\n<b name="\xfc"/></a>'
    document = parse_document(data.encode("latin-1" if "latin" in encoding else "utf-8"), "a.urdf")
    assert document.root[0].get("name") == "\xfc"
    assert [place.line for place in document.places.values()] == [4, 5]
    (note,) = document.findings
    assert (note.rule, note.location.line) == ("late-declaration", 2)


def test_another_encoding_is_named() -> None:
    text = '<a>\n<b name="fl\xfcgel"/></a>'.encode("latin-1")
    reason = "not well-formed (invalid token)"
    assert said(text) == f"{reason}; the byte 0xfc is not UTF-8: save the file as UTF-8"


def test_a_long_name_is_cut() -> None:
    assert said(b"<" + b"a" * 10_000 + b"></b>") == (
        f"mismatched tag: found </b>, expected the end of <{'a' * 60}...> from line 1"
    )


@given(st.lists(st.sampled_from(["<a>", "</a>", "<b", ">", "</b>", "&", "<", "\n", "\0", "ä", "x=", '"', "<?xml?>"])))
def test_any_text_is_explained(parts: list[str]) -> None:
    # The last one is never closed.
    assert said("".join([*parts, "<a>"]).encode("latin-1")).isprintable()
