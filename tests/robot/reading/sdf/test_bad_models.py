"""What is wrong with an SDF is told with its rule, its line and what to do; nothing else can happen."""

from __future__ import annotations

import random
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ModelError, RefusedModel
from sim_action.robot.model.findings import ALLOWABLE, RULES
from tests.robot.reading.sdf.bad_models import BAD_SDF_MODELS, GOOD, BadSdf
from tests.robot.reading.sdf.models import joint, link, load, sdf
from tests.robot.reading.test_urdf import TETRAHEDRON
from tests.ros_workspace import written
from tests.soak import examples
from tests.work import work_of


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder with files that may be included."""
    folder = tmp_path / "workspace"
    written(folder / "good.sdf", GOOD)
    written(folder / "arm.urdf", '<robot name="arm"><link name="base"/></robot>')
    written(folder / "a.stl", TETRAHEDRON)
    return folder


def refused(folder: Path, text: str) -> RefusedModel:
    with pytest.raises(RefusedModel) as raised:
        load(folder, text)
    return raised.value


def test_a_good_model_has_no_findings(workspace: Path) -> None:
    assert load(workspace, GOOD).findings == ()


@pytest.mark.parametrize("bad", BAD_SDF_MODELS, ids=lambda bad: bad.name)
def test_a_bad_model_breaks_its_rule_on_its_line(bad: BadSdf, workspace: Path) -> None:
    if RULES[bad.rule].level == "warning":
        (found,) = (found for found in load(workspace, bad.text).findings if found.rule == bad.rule)
        assert found.location.line == bad.line
        assert bad.words in found.message
        return
    with pytest.raises(RefusedModel) as refused:
        load(workspace, bad.text)
    problem = refused.value.problems[0]
    assert (problem.message.rpartition("[")[2], problem.location.line) == (f"{bad.rule}]", bad.line)
    assert bad.words in problem.message
    assert problem.message.isprintable()


@pytest.mark.parametrize("rule", ["unsupported-joint", "unsupported-part", "impossible-inertia"])
def test_an_error_can_be_let_go_and_is_told_all_the_same(rule: str, workspace: Path) -> None:
    bad = next(bad for bad in BAD_SDF_MODELS if bad.rule == rule)
    (finding,) = (found for found in load(workspace, bad.text, (rule,)).findings if found.level == "error")
    assert (finding.rule, finding.location.line) == (rule, bad.line)


def test_all_that_is_wrong_is_told_at_once(workspace: Path) -> None:
    text = GOOD.replace("<mass>1", "<mass>heavy").replace("0 0 1</xyz>", "</xyz>")
    text = text.replace("</model>", '<frame name="f" attached_to="tol"/></model>')
    with pytest.raises(RefusedModel) as refused:
        load(workspace, text)
    assert {problem.location.line for problem in refused.value.problems} == {5, 7}
    with pytest.raises(RefusedModel) as refused:
        load(workspace, GOOD.replace("<mass>1", "<mass>heavy"))
    assert [problem.location.line for problem in refused.value.problems] == [3, 4]


def test_a_name_in_an_included_model_has_a_nearest_one(workspace: Path) -> None:
    include = "<include><uri>good.sdf</uri><name>l</name></include>"
    (problem,) = refused(workspace, sdf(link("a"), include, joint("j", "a", "l::bas"))).problems
    told = "<child> refers to 'l::bas', but that model has no 'bas'; did you mean 'base'? (allowed: "
    assert problem.message.startswith(told)


def test_what_is_wrong_in_a_file_is_told_once_however_often_it_is_included(workspace: Path) -> None:
    written(workspace / "bad.sdf", GOOD.replace("<mass>1", "<mass>heavy"))
    once, thrice = (refused(workspace, including(count, "bad.sdf")) for count in (1, 3))
    assert once.problems == thrice.problems


def test_files_that_include_each_other_are_named(workspace: Path) -> None:
    written(workspace / "b.sdf", sdf("<include><uri>robot.sdf</uri></include>"))
    with pytest.raises(RefusedModel, match=r"robot.sdf -> b.sdf -> robot.sdf \[include-loop\]"):
        load(workspace, sdf("<include><uri>b.sdf</uri></include>"))


def test_a_model_that_grows_without_end_is_refused(workspace: Path) -> None:
    for n in range(12):
        twice = "".join(f"<include><uri>m{n + 1}.sdf</uri><name>n{k}</name></include>" for k in range(2))
        written(workspace / f"m{n}.sdf", sdf(twice))
    written(workspace / "m12.sdf", sdf(link("a")))
    with pytest.raises(RefusedModel, match=r"may include at most 500 others \[include-loop\]$"):
        load(workspace, sdf("<include><uri>m0.sdf</uri></include>"))


def including(count: int, uri: str) -> str:
    return sdf(link("a"), *(f"<include><uri>{uri.format(n)}</uri><name>n{n}</name></include>" for n in range(count)))


@pytest.mark.parametrize(
    ("filling", "words"),
    [
        ("<frame/>" * 20_000, "a model may have at most 50,000 elements"),
        (f"<plugin>{'x' * 9_000_000}</plugin>", "a model may have at most 20 MB"),
    ],
    ids=["elements", "bytes"],
)
def test_reading_ends_where_a_model_has_too_much(filling: str, words: str, workspace: Path) -> None:
    for number in range(3):
        written(workspace / f"m{number}.sdf", sdf(filling))
    # The fourth is not there: it would be told if it was looked for.
    error = refused(workspace, including(4, "m{}.sdf"))
    assert "m3.sdf" not in str(error)
    assert words in str(error)
    assert "[include-loop]" in error.problems[0].message


def test_what_is_included_again_counts_again(workspace: Path) -> None:
    written(workspace / "m.sdf", sdf("<plugin><a/></plugin>" * 10_000))
    assert "a model may have at most 50,000 elements" in str(refused(workspace, including(3, "m.sdf")))


def test_the_manifest_of_a_model_is_read_once_and_counts(workspace: Path) -> None:
    written(workspace / "w/model.sdf", sdf(link("a")))
    manifest = workspace / "w/model.config"
    written(manifest, "<model><sdf>model.sdf</sdf></model>")
    once = work_of(lambda: refused(workspace, including(1, "w")))
    written(manifest, f"<model><sdf>model.sdf</sdf>{'<a/>' * 2_000}</model>")
    # Parsing it 50 times would take as many times 100,000.
    assert work_of(lambda: refused(workspace, including(50, "w"))) < 50 * once + 200_000
    written(manifest, f"<model><sdf>model.sdf</sdf>{'x' * 19_999_900}</model>")
    assert "a model may have at most 20 MB" in str(refused(workspace, including(1, "w")))


@pytest.mark.parametrize("inner", ["<link name='{}'/>", "<frame name='{}'/>", "<model name='{}'/>"])
def test_a_name_with_those_of_the_models_around_it_is_none_too_long(inner: str, workspace: Path) -> None:
    outer = f"<model name='{'o' * 200}'>\n{inner}</model>"
    error = refused(workspace, sdf(outer.format("i" * 54), link("a")))
    assert (error.problems[0].location.line, "[bad-name]" in str(error)) == (4, True)
    assert "the name has 256 characters, 'oooo" in str(error)
    kept = sdf(outer.format("i" * 53), link("a"), joint("j", "a", "a"))
    assert "[bad-name]" not in str(refused(workspace, kept))


def test_models_are_not_nested_without_end(workspace: Path) -> None:
    for n in range(60):
        written(workspace / f"m{n}.sdf", sdf(f"<include merge='1'><uri>m{n + 1}.sdf</uri></include>"))
    written(workspace / "m60.sdf", sdf(link("a")))
    with pytest.raises(RefusedModel, match=r"more than 50 models are nested"):
        load(workspace, sdf("<include><uri>m0.sdf</uri></include>"))


def test_names_that_lead_nowhere_cost_the_same_each(tmp_path: Path) -> None:
    def work(count: int) -> int:
        frames = (f'<frame name="frame{number}" attached_to="fram{number}"/>' for number in range(count))
        return work_of(lambda: refused(tmp_path, sdf(link("a"), *frames)))

    work(50)  # what is done once is done
    # The first few are compared with all names.
    few, some, many = map(work, (50, 100, 200))
    assert many - some < 1.2 * 2 * (some - few) + 1_000


WORDS = ("0", "-1", "nan", "1e309", "0 0 1", "0 0 1 0 0 0", "world", "base", "tool", "a::tool", "__model__", "true", "")
DONORS = [
    element
    for bad in BAD_SDF_MODELS
    if "<?xml" not in bad.text and bad.rule != "bad-xml"
    for element in ET.fromstring(bad.text).iter()
]


def mutate(choices: random.Random, root: ET.Element) -> None:
    """Changes one thing in a document, which stays XML."""
    elements = list(root.iter())
    element, donor = choices.choice(elements), choices.choice(DONORS)
    change = choices.randrange(5)
    if change == 0:
        element.append(deepcopy(donor))
    elif change == 1 and len(element):
        element.remove(choices.choice(list(element)))
    elif change == 2:
        element.text = choices.choice((*WORDS, donor.text))
    elif change == 3:
        names = ("relative_to", "attached_to", "expressed_in", "name", "type", "merge", "placement_frame", "version")
        element.set(choices.choice(names), choices.choice(WORDS))
    else:
        element.tag = donor.tag


@given(seed=st.integers(0, 2**32), changes=st.integers(1, 8))
@examples(150)
def test_whatever_becomes_of_a_file_it_is_read_or_refused(
    seed: int, changes: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    choices, root = random.Random(seed), ET.fromstring(GOOD)
    for _ in range(changes):
        mutate(choices, root)
    with suppress(ModelError):
        load(tmp_path_factory.getbasetemp(), ET.tostring(root, encoding="unicode"), ALLOWABLE)
