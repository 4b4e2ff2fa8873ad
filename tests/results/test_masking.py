"""Values of passed variables do not reach results, and missing variables are explained."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import Location
from sim_action.results.masking import MIN_CHARS, Mask
from sim_action.results.outcome import Diagnostic, ExpectationOutcome, Failure, Outcome
from sim_action.scenario.child_environment import missing_variable
from sim_action.state.verdict import Verdict
from sim_action.world.claims import AuditWarning

HERE = Location("a.sim.yml", 3)
SECRET = "open sesame"


def outcome(text: str) -> Outcome:
    """An outcome with a text wherever code can write one."""
    verdict = Verdict(passed=False, unit=text, message=text, body=text, joint=text)
    return Outcome(
        name=text,
        file="a.sim.yml",
        status="error",
        expectations=(ExpectationOutcome(name=text, assertion="x", severity="error", location=HERE, verdict=verdict),),
        failures=(Failure(kind="script", title="t", message=text, details=text, location=Location(text)),),
        notes=(text,),
        warnings=(AuditWarning(rule="r", message=text, location=HERE),),
        diagnostics=(Diagnostic(level="note", message=text),),
        output=text,
    )


def test_values_that_are_masked() -> None:
    # Every text of code is masked.
    mask = Mask.of({"A": SECRET, "B": "other"}, ("A", "C"))
    masked = mask.outcome(outcome(f"<{SECRET}> other"), names=True)
    assert masked == outcome("<***> other")
    kept = mask.outcome(outcome(SECRET))
    assert (kept.name, kept.expectations[0].name, kept.output) == (SECRET, SECRET, "***")
    # Without values nothing changes.
    found = outcome(SECRET)
    assert Mask.of({}, ("A",)).outcome(found) is found
    assert Mask.of({"A": SECRET}, ()).text(SECRET) == SECRET
    assert Mask.of({"A": ""}, ("A",)).text("") == ""
    # Short values are left.
    assert Mask.of({"A": "x" * (MIN_CHARS - 1)}, ("A",)).text("xxxx") == "xxxx"
    assert Mask.of({"A": "x" * MIN_CHARS}, ("A",)).text("xxxx") == "***"
    assert Mask.of({"A": "1234", "B": "123456"}, ("A", "B")).text("123456 1234") == "*** ***"
    # Each line of a value is masked.
    mask = Mask.of({"A": "-----BEGIN\nabcdef\n}\n"}, ("A",))
    assert mask.text("abcdef } -----BEGIN") == "*** } ***"


@given(st.text(min_size=MIN_CHARS).filter(lambda text: len(text.strip()) >= MIN_CHARS))
def test_values_and_their_escaped_forms_are_masked(value: str) -> None:
    mask = Mask.of({"A": value}, ("A",))
    for form in (value, json.dumps(value)[1:-1], json.dumps(value, ensure_ascii=False)[1:-1], repr(value)[1:-1]):
        assert mask.text(f"<{form}>") == "<***>"


def test_a_replay_is_masked(tmp_path: Path) -> None:
    path, mask = tmp_path / "r.json.gz", Mask.of({"A": SECRET}, ("A",))
    stored = {"name": f"a {SECRET}", "joint_names": [SECRET], "kind": SECRET}
    path.write_bytes(gzip.compress(json.dumps(stored).encode()))
    mask.replay(path)
    replay = json.loads(gzip.decompress(path.read_bytes()))
    assert replay == {"name": "a ***", "joint_names": ["***"], "kind": SECRET}
    for content in (b"", b"no archive", gzip.compress(b"\xff")[:-3]):
        path.write_bytes(content)
        mask.replay(path)
        assert path.read_bytes() == content
    mask.replay(tmp_path / "absent")
    assert [each.name for each in tmp_path.iterdir()] == ["r.json.gz"]


MESSAGES = [
    "KeyError: 'MAP_URL'",
    "it ended; its last line on standard error: KeyError: 'MAP_URL'",
    "environment variable 'MAP_URL' is not set",
    "drive.sh: line 3: MAP_URL: unbound variable",
    "sh: 1: MAP_URL: parameter not set",
]


@pytest.mark.parametrize("message", MESSAGES)
def test_a_missing_variable_is_explained(message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert missing_variable(message) is None
    monkeypatch.setenv("MAP_URL", "x")
    assert missing_variable(message, ["MAP_URL"]) is None
    assert missing_variable(message) == "MAP_URL"
    (failure,) = Mask().outcome(outcome(message)).failures
    assert failure.message.startswith(f"{message}; the variable MAP_URL exists, but code of the repository does not")
    assert "--pass-env MAP_URL" in failure.message
    assert "environment:" in failure.message
    assert "\n" not in failure.message
    (failure,) = Mask().outcome(outcome(message), states=False).failures
    assert "environment:" not in failure.message


@pytest.mark.parametrize("message", MESSAGES)
def test_a_variable_that_is_passed_but_not_set_is_explained(message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mask = Mask.of({}, ("MAP_URL",))
    (failure,) = mask.outcome(outcome(message)).failures
    assert failure.message == (
        f"{message}; --pass-env (input pass-env of the action) names the variable MAP_URL, but it is not set; "
        "set it before sim-action starts, on GitHub with 'env:' of the step"
    )
    monkeypatch.setenv("MAP_URL", "x")
    (failure,) = mask.outcome(outcome(message)).failures
    assert failure.message == message


def test_another_key_is_no_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH_OF_MINE", "x")
    for message in ("KeyError: 'left'", "KeyError: 'PATH'", "KeyError: 3", "PATH_OF_MINE is mentioned"):
        assert missing_variable(message) is None
