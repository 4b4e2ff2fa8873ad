"""What is done to URDFs: attributes and elements lost, doubled, moved, renamed, nested, or saying something else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final
from xml.sax.saxutils import quoteattr

from tests.fuzz.urdf_texts import ODD_NAMES, Chance, robot_text

_ODD_TEXTS: Final = (
    "", " ", "nan", "-nan", "inf", "1e308", "-1e308", "1e999", "1e-320", "-0", "+5", "0x1", "0x1p3", ".5", "5.", "1_0",
    "1,5", "1;2;3", "0 0 0", "0 0 1", "1 1 1 1", "0\t0\t1", "\u0661", "\u00a01", "1\u20030 0", "x" * 50, "${x}",
    "$(arg x)", "true", "l0", "j0", "1e10", "1e20", "1e-20", "1e155", "-1", "0", "9" * 400, "0." + "0" * 400 + "1",
    "part.obj", "../part.obj", "file:///etc/hostname", "package://p/part.obj", "1e", "1d3", "1f", "0b1", "infinity",
    "1 0 0 # x",
)  # fmt: skip
_STRAYS: Final = (
    "<!-- c -->", "<?go now?>", "<![CDATA[<link/>]]>", "text", "&lt;", "&#10;", "<link/>",
    "<joint/>", "<inertial/>", '<origin xyz="5 5 5"/>', '<mass value="7"/>', '<axis xyz="0 1 0"/>', "<limit/>",
    '<dynamics damping="1"/>', "<dynamics/>", '<box size="1 1 1"/>', "<geometry/>", '<sphere radius="1"/>',
    '<x:y xmlns:x="urn:z"/>', "<deformable/>", '<deformable name="d"><inertial/></deformable>', "<axis/>", "<plane/>",
    '<contact><lateral_friction value="2"/><stiffness value="1e9"/><damping value="1"/></contact>', "<gazebo/>",
    "<contact><inertia_scaling value='9'/></contact>", "<contact><friction_anchor/></contact>", "<sensor/>",
    "<bullet><user-data key='a'>b</user-data></bullet>", "<self_collision_checking/>", '<mimic joint="j0"/>',
    "<safety_controller soft_lower_limit='-1' k_velocity='1'/>", "<calibration rising='0'/>", "<transmission/>",
    '<joint name="e" type="fixed"><parent link="l0"/><child link="l1"/></joint>', '<link name="e"/>',
    '<reduced_deformable name="r"/>', "<audio_source filename='a'/>", "<collision/>", "<world/>", "<sdf/>",
    '<link name="stray"><inertial><mass value="1"/></inertial></link>', "&amp;", "<material name='m'/>",
)  # fmt: skip
_HEADS: Final = (
    '<?xml version="1.0"?>', '<?xml version="1.1"?>', '<?xml version="1.0" encoding="UTF-8"?>', "\ufeff", "\n\n", " ",
    '<?xml version="1.0" encoding="utf-16"?>', '<?xml version="1.0" encoding="latin-1"?>', "<!-- c -->",
    '<?xml version="1.0" standalone="yes"?>', "<!DOCTYPE robot>", '<?xml-stylesheet href="a"?>',
)  # fmt: skip


_WORDS: Final = (
    "link", "joint", "inertial", "collision", "geometry", "origin", "mass", "axis", "limit", "parent", "child", "xyz",
    "rpy", "name", "lower", "upper", "radius", "size", "length", "revolute", "continuous", "fixed",
)  # fmt: skip


def mutated(text: str, chance: Chance) -> str:
    """A model with one to three things done to it that people, editors and exporters do."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        text = chance.choice(_MUTATIONS)(text, chance)
    return text


def _spans(text: str, opening: str, closing: str) -> list[tuple[int, int]]:
    """Of what lies between two marks, without the marks."""
    spans, at = list[tuple[int, int]](), text.find(opening)
    while at >= 0:
        end = text.find(closing, at + len(opening))
        if end < 0:
            break
        spans.append((at + len(opening), end))
        at = text.find(opening, end + len(closing))
    return spans


def _other_text(text: str, chance: Chance) -> str:
    """An attribute says something else."""
    spans = _spans(text, '"', '"')
    if not spans:
        return text
    start, end = chance.choice(spans)
    new = quoteattr(chance.choice((*_ODD_TEXTS, *ODD_NAMES)))[1:-1].replace('"', "'")
    return text[:start] + new + text[end:]


def _other_word(text: str, chance: Chance) -> str:
    """One number of several is another one."""
    spans = _spans(text, '"', '"')
    if not spans:
        return text
    start, end = chance.choice(spans)
    words = text[start:end].split(" ")
    words[chance.randrange(len(words))] = chance.choice(_ODD_TEXTS).replace("&", "").replace('"', "")
    return text[:start] + " ".join(words) + text[end:]


def _attributes(text: str) -> list[tuple[int, int]]:
    return [(text.rfind(" ", 0, start - 1), end + 1) for start, end in _spans(text, '"', '"')]


def _no_attribute(text: str, chance: Chance) -> str:
    spans = [(start, end) for start, end in _attributes(text) if start >= 0]
    if not spans:
        return text
    start, end = chance.choice(spans)
    return text[:start] + text[end:]


def _attribute_moved(text: str, chance: Chance) -> str:
    """An attribute is repeated, in its own element or in another."""
    spans = [(start, end) for start, end in _attributes(text) if start >= 0]
    if not spans:
        return text
    start, end = chance.choice(spans)
    _, to = chance.choice(spans)
    return text[:to] + text[start:end] + text[to:]


def _elements(text: str) -> list[tuple[int, int]]:
    """Of elements that end in themselves, and of whole lines."""
    empty = [(start - 1, end + 2) for start, end in _spans(text, "<", "/>")]
    whole = [
        (start - len(tag) - 1, end + len(tag) + 3)
        for tag in ("link", "joint", "inertial", "collision", "geometry", "visual")
        for start, end in _spans(text, f"<{tag}", f"</{tag}>")
    ]
    return [(max(text.rfind("<", 0, end - 2), 0), end) for _, end in empty] + whole


def _no_element(text: str, chance: Chance) -> str:
    spans = _elements(text)
    if not spans:
        return text
    start, end = chance.choice(spans)
    return text[:start] + text[end:]


def _element_moved(text: str, chance: Chance) -> str:
    """An element is somewhere else, or there twice."""
    spans = _elements(text)
    if not spans:
        return text
    start, end = chance.choice(spans)
    _, to = chance.choice(spans)
    twice = text[:to] + text[start:end] + text[to:]
    if chance.random() < 0.5:
        return twice
    return twice[:start] + twice[end:] if to >= end else twice[: start + end - start] + twice[2 * end - start :]


def _stray(text: str, chance: Chance) -> str:
    """Something stands between two elements."""
    places = [end + 1 for _, end in _spans(text, "<", ">")]
    if not places:
        return text
    to = chance.choice(places)
    return text[:to] + chance.choice(_STRAYS) + text[to:]


def _inside(text: str, chance: Chance) -> str:
    """Something stands in an element that had nothing in it."""
    ends = [end for _, end in _spans(text, "<", "/>")]
    if not ends:
        return text
    end = chance.choice(ends)
    start = text.rfind("<", 0, end)
    tag = text[start + 1 : end].split(maxsplit=1)[0] if text[start + 1 : end].split() else "x"
    return f"{text[:end]}>{chance.choice(_STRAYS)}</{tag}>{text[end + 2 :]}"


def _wrapped(text: str, chance: Chance) -> str:
    """An element is nested in another."""
    spans = _elements(text)
    if not spans:
        return text
    start, end = chance.choice(spans)
    tag = chance.choice(("group", "link", "joint", "robot", "gazebo", "collision", "geometry", "inertial"))
    return f"{text[:start]}<{tag}>{text[start:end]}</{tag}>{text[end:]}"


def _renamed(text: str, chance: Chance) -> str:
    word = chance.choice(_WORDS)
    other = chance.choice((*_WORDS, word.upper(), f"x{word}", "spherical", "ball", "capsule", "plane", "cdf"))
    return text.replace(word, other, chance.choice((1, 1, -1)))


def _damaged(text: str, chance: Chance) -> str:
    """Characters are lost, doubled, or others."""
    start = chance.randrange(len(text)) if text else 0
    end = min(len(text), start + chance.choice((1, 3, 20)))
    middle = chance.choice(("", text[start:end] * 2, "\0", "\x0b", "\ufeff", "<", ">", '"', "&", "é", "\ud7ff"))
    return text[:start] + middle + text[end:]


def _headed(text: str, chance: Chance) -> str:
    return chance.choice(_HEADS) + text


def _spaced(text: str, chance: Chance) -> str:
    name = chance.choice((' xmlns="urn:x"', ' xmlns:xacro="http://ros.org/wiki/xacro"', ' xmlns:x=""', ' x:y="1"'))
    return text.replace("<robot", f"<robot{name}", 1)


_MUTATIONS: Final[tuple[Callable[[str, Chance], str], ...]] = (
    _other_text, _other_text, _other_text, _other_word, _other_word, _no_attribute, _attribute_moved, _no_element,
    _element_moved, _element_moved, _stray, _stray, _inside, _wrapped, _renamed, _damaged, _headed, _spaced,
)  # fmt: skip


def model_bytes(chance: Chance) -> bytes:
    """A model as a file holds it: right one time in three."""
    text = robot_text(chance)
    if chance.random() < 0.67:
        text = mutated(text, chance)
    encoding = chance.choice(("utf-8",) * 12 + ("utf-8-sig", "utf-16", "latin-1", "utf-16-le"))
    return text.encode(encoding, errors="replace")
