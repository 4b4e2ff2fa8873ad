"""From the files and the output of a launch to outcomes: one for each test."""
