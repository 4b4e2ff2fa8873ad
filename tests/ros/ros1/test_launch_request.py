"""The files that the command and the node exchange."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros1.launch_request import RUN_FILE, SimulationResult, new_run_folder, run_folders


def test_each_start_has_a_folder_of_its_own_in_the_order_of_starts(tmp_path: Path) -> None:
    made = [new_run_folder(tmp_path) for _ in range(11)]
    (tmp_path / "results").mkdir()

    assert run_folders(tmp_path) == made
    assert made[-1].name == "11"


def test_what_is_told_is_read_again(tmp_path: Path) -> None:
    told = SimulationResult(end="time limit", sim_time=30.0, travelled=0.0, messages={"/clock published": 3000})
    told.write(tmp_path)

    assert SimulationResult.read(tmp_path) == told


def test_what_cannot_be_understood_is_nothing(tmp_path: Path) -> None:
    assert SimulationResult.read(tmp_path) is None
    (tmp_path / RUN_FILE).write_text('{"end": "tired"}')
    assert SimulationResult.read(tmp_path) is None
