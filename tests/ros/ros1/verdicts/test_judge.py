"""The outcomes of tests from their findings, without ROS."""

from __future__ import annotations

from sim_action.results.outcome import Outcome
from sim_action.ros.ros1.launch_request import LaunchRequest
from sim_action.ros.ros1.verdicts import findings
from sim_action.ros.ros1.verdicts.judge import Judge
from sim_action.ros.ros1.verdicts.rostest_files import Case, Suite

PASSED, SKIPPED = Case("test_a"), Case("test_b", "skipped", "pytest.skip", "no lidar")


def judged(*cases: Case) -> Outcome:
    test = findings.TestFindings("moves", methods=Suite(cases))
    judge = Judge(LaunchRequest("rostest", "robot", "moves.test"), "moves.test", wall_time=1.0)
    found = findings.Findings("over", 0, (test,), (), "", 30.0)
    ((outcome, _),) = judge.outcomes(found)
    return outcome


def test_a_test_that_skips_all_of_its_cases_is_not_exercised() -> None:
    outcome = judged(SKIPPED)
    assert outcome.status == "not_exercised"
    assert outcome.expectations[0].verdict.message == (
        "never checked: the test skipped this case (no lidar); let it run, or remove it"
    )


def test_a_test_that_skips_one_of_its_cases_passes_with_a_warning() -> None:
    outcome = judged(PASSED, SKIPPED)
    assert (outcome.status, outcome.display_status) == ("passed", "warned")
    assert [expected.status for expected in outcome.expectations] == ["passed", "warned"]


def test_a_case_that_failed_decides() -> None:
    outcome = judged(PASSED, SKIPPED, Case("test_c", "failure", "AssertionError", "0 != 1"))
    assert outcome.status == "failed"
    assert judged(PASSED).display_status == "passed"
