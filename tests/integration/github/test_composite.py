"""Composite actions: which steps run, what they see, and what comes out."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.integration.github import ActionResult, UnsupportedFeature
from tests.integration.github.conftest import Act

OTHER = "actions/setup-python@5fda3b95a4ea91299a34e894583c3862153e4b97"


def action(steps: str, inputs: str = "{}", outputs: str = "{}") -> str:
    return f"name: a\ninputs: {inputs}\noutputs: {outputs}\nruns:\n  using: composite\n  steps:\n{steps}"


def run(script: str, **keys: str) -> str:
    more = "".join(f", {key.replace('_', '-')}: {value}" for key, value in keys.items())
    return f"    - {{shell: bash, run: '{script}'{more}}}\n"


def outcomes(result: ActionResult) -> list[tuple[str, str]]:
    return [(step.outcome, step.conclusion) for step in result.step_results]


def test_outputs_are_handed_on_although_a_step_failed(act: Act) -> None:
    steps = run('echo answer=42 >> "$GITHUB_OUTPUT"; exit 3', id="first") + run("true", id="last")
    outputs = '{answer: {value: "${{ steps.first.outputs.answer }}!"}, none: {value: "${{ steps.last.outputs.x }}"}}'
    result = act(action(steps, outputs=outputs))
    assert result.exit_code == 3
    assert result.outputs == {"answer": "42!", "none": ""}
    assert outcomes(result) == [("failure", "failure"), ("skipped", "skipped")]


def test_bash_stops_at_the_first_failure_even_in_a_pipe(act: Act) -> None:
    result = act(action(run("false | cat; echo reached")))
    assert (result.exit_code, result.log) == (1, "")


def test_after_a_failure_only_who_asks_for_it_runs(act: Act) -> None:
    steps = run("exit 4", name="fails")
    for condition in ("success()", "always()", "failure()", "!cancelled()", "cancelled()", "true", "always() && false"):
        steps += run("true", name=f'"{condition}"', **{"if": f'"{condition}"'})
    result = act(action(steps))
    assert result.steps == ("fails", "always()", "failure()", "!cancelled()")
    assert result.exit_code == 4


def test_conditions_see_inputs_steps_and_the_event(act: Act) -> None:
    conditions = {
        "not ready": "inputs.cache == 'true' && steps.look.outputs.ready != 'true'",
        "on a push": "github.event_name == 'push'",
        "from env": "env.A == 'b'",
    }
    steps = run('echo ready=true >> "$GITHUB_OUTPUT"', id="look", name="look")
    for name, condition in conditions.items():
        steps += run("true", name=name, env="{A: b}", **{"if": f'"${{{{ {condition} }}}}"'})
    text = action(steps, inputs='{cache: {default: "true"}}')
    assert act(text).steps == ("look", "on a push", "from env")
    assert act(text, event_name="pull_request_target").steps == ("look", "from env")


def test_forgiven_failure(act: Act) -> None:
    steps = run("exit 5", id="try", continue_on_error="true") + run("true")
    steps += run("false", **{"if": "\"steps.try.outcome == 'failure' && steps.try.conclusion == 'success'\""})
    result = act(action(steps))
    assert outcomes(result) == [("failure", "success"), ("success", "success"), ("failure", "failure")]
    assert result.exit_code == 1


def test_inputs_have_defaults_and_are_not_enforced(act: Act) -> None:
    inputs = '{a: {default: "${{ github.event_name }}"}, b: {required: true}, c: {default: 3.10}, d: {default: x}}'
    outputs = '{all: {value: "${{ inputs.a }},${{ inputs.b }},${{ inputs.c }},${{ inputs.d }}"}}'
    assert act(action(run("true"), inputs, outputs), {"d": ""}).outputs == {"all": "push,,3.1,"}


def test_steps_see_the_runner_and_the_event(act: Act, tmp_path: Path) -> None:
    script = 'echo "$GITHUB_EVENT_NAME,$RUNNER_OS,$RUNNER_ARCH,$GITHUB_ACTION_PATH,$GITHUB_REPOSITORY,$CI,$PWD"'
    outputs = '{all: {value: "${{ runner.os }} ${{ runner.arch }} ${{ runner.temp }} ${{ github.workspace }}"}}'
    result = act(action(run(script), outputs=outputs), os="macOS", arch="ARM64", event_name="schedule")
    workspace = tmp_path / "work space"
    assert result.log == f"schedule,macOS,ARM64,{tmp_path / 'action'},octocat/robots,true,{workspace}\n"
    assert result.outputs["all"] == f"macOS ARM64 {tmp_path / 'runner temp'} {workspace}"


def test_event_is_a_file_and_a_context(act: Act) -> None:
    steps = run('cat "$GITHUB_EVENT_PATH"') + run(
        "echo $NUMBER", env='{NUMBER: "${{ github.event.pull_request.number }}"}'
    )
    result = act(action(steps), event_name="pull_request", event={"pull_request": {"number": 7}})
    assert result.log == '{"pull_request": {"number": 7}}7\n'


def test_environment_comes_from_job_and_step_and_never_from_these_tests(
    act: Act, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GITHUB_TOKEN", "INPUT_X", "PYTHONPATH", "ACTIONS_CACHE_URL"):
        monkeypatch.setenv(name, "foreign")
    monkeypatch.setenv("MACHINE", "here")
    steps = run("env | grep -c foreign || true; echo $MACHINE $JOB $STEP", env='{STEP: 1, JOB: "${{ env.JOB }}s"}')
    assert act(action(steps), variables={"JOB": "job"}).log == "0\nhere jobs 1\n"


def test_nobody_changes_what_the_runner_says(act: Act) -> None:
    steps = run('echo GITHUB_EVENT_NAME=a >> "$GITHUB_ENV"') + run(
        "echo $GITHUB_EVENT_NAME", env="{GITHUB_EVENT_NAME: b}"
    )
    assert act(action(steps), variables={"GITHUB_EVENT_NAME": "c"}).log == "push\n"


def test_what_is_exported_reaches_later_steps(act: Act, tmp_path: Path) -> None:
    steps = run(f'printf "A<<E\\n1\\n2\\nE\\n" >> "$GITHUB_ENV"; printf "/first\\n{tmp_path}\\n" >> "$GITHUB_PATH"')
    steps += run('echo "$A"; echo "${PATH%%:*}"')
    result = act(action(steps))
    assert result.log == f"1\n2\n{tmp_path}\n"
    assert result.exported == f"A<<E\n1\n2\nE\n/first\n{tmp_path}\n"


def test_summaries_are_joined_and_one_too_long_is_dropped(act: Act) -> None:
    steps = run('echo one >> "$GITHUB_STEP_SUMMARY"') + run('head -c 1048577 /dev/zero >> "$GITHUB_STEP_SUMMARY"')
    result = act(action(steps + run('echo two >> "$GITHUB_STEP_SUMMARY"')))
    assert result.summary == "one\ntwo\n"
    assert [annotation.level for annotation in result.annotations] == ["error"]
    assert result.exit_code == 0


def test_a_stopped_log_is_stopped_for_one_step(act: Act) -> None:
    result = act(action(run("echo ::stop-commands::t; echo ::error::1") + run("echo ::error::2")))
    assert [annotation.message for annotation in result.annotations] == ["2"]


@pytest.mark.parametrize("script", ['echo nonsense >> "$GITHUB_OUTPUT"', 'echo nonsense >> "$GITHUB_ENV"'])
def test_what_the_runner_cannot_process_fails_the_step(act: Act, script: str) -> None:
    result = act(action(run(script) + run("true")))
    assert (result.exit_code, result.step_results[1].outcome) == (1, "skipped")


def test_a_step_may_remove_its_files_and_print_what_is_no_text(act: Act) -> None:
    assert act(action(run('rm "$GITHUB_OUTPUT"; printf "\\\\377"'))).log == "\ufffd"


def test_a_signal_is_an_exit_code(act: Act) -> None:
    assert act(action(run("kill -KILL $$"))).exit_code == 137


def test_nothing_stays_behind_in_temp(act: Act, tmp_path: Path) -> None:
    act(action(run("true")))
    assert os.listdir(tmp_path / "runner temp") == []  # noqa: PTH208 - names are what is asked for


def test_other_actions_stand_in_with_their_outputs(act: Act) -> None:
    steps = f"    - {{id: python, uses: {OTHER}, with: {{python-version: '3.11', update-environment: false}}}}\n"
    steps += run('"$PYTHON" --version', env='{PYTHON: "${{ steps.python.outputs.python-path }}"}')
    result = act(action(steps))
    assert result.log.startswith("Python 3.11.")
    assert result.exported == ""


def test_names_of_steps_that_have_none(act: Act) -> None:
    steps = run("true") + "    - shell: bash\n      run: |\n        true ${{\n        '1' }}\n"
    steps += f"    - {{uses: {OTHER}, with: {{python-version: '3.11'}}}}\n"
    assert act(action(steps)).steps == ("Run true", "Run true 1", f"Run {OTHER}")


@pytest.mark.parametrize(
    "text",
    [
        action("    - {shell: sh, run: 'true'}\n"),
        action("    - {run: 'true'}\n"),
        action("    - {shell: bash}\n"),
        action("    - {shell: bash, run: 'true', timeout-minutes: 1}\n"),
        action("    - {shell: bash, run: 'true', uses: ./}\n"),
        action("    - {shell: bash, run: 'true', working-directory: a}\n"),
        action("    - {shell: bash, run: 'true', continue-on-error: '${{ true }}'}\n"),
        action("    - {uses: ./, working-directory: a}\n"),
        action(f"    - {{uses: {OTHER}, with: {{python-version: '3.12'}}}}\n"),
        action(f"    - {{uses: {OTHER}, with: {{python-version: '3.11', cache: pip}}}}\n"),
        action("    - {uses: actions/setup-python@v7}\n"),
        action("    - {uses: docker://alpine}\n"),
        action("    - {uses: actions/checkout@3d3c42e5aac5ba805825da76410c181273ba90b1}\n"),
        action(run("true", env="{A: '${{ secrets.GITHUB_TOKEN }}'}".replace("'", '"'))),
        action(run("true", env='{A: "${{ steps.typo.outputs.x }}"}')),
        action(run("true", env='{A: "${{ inputs.typo }}"}')),
        action(run("true", env='{A: "${{ github.typo }}"}')),
        action(run("true", env='{A: "${{ matrix.x }}"}')),
        action(run("true"), inputs="{a: {type: string}}"),
        action(run("true"), outputs="{a: {value: x, type: y}}"),
        action(run("true")).replace("composite", "node20"),
        action(run("true")).replace("name: a", "pre: a"),
        action(run('echo x > "$GITHUB_STATE"')),
        action(run("echo ::add-mask::x")),
    ],
)
def test_what_is_not_known_is_refused(act: Act, text: str) -> None:
    with pytest.raises(UnsupportedFeature):
        act(text)


def test_unexpected_inputs_are_a_warning(act: Act) -> None:
    outputs = '{a: {value: "${{ inputs.a }}"}}'
    result = act(action(run("true"), "{a: {}, b: {}}", outputs), {"typo": "x", "A": "given", "other": ""})
    assert [(annotation.level, annotation.message) for annotation in result.annotations] == [
        ("warning", "Unexpected input(s) 'typo', 'other', valid inputs are ['a', 'b']")
    ]
    assert (result.exit_code, result.outputs) == (0, {"a": "given"})
