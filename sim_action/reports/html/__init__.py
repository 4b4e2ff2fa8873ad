"""The report `report.html`: one file with the list of scenarios, their verdicts, drawings and replays."""
