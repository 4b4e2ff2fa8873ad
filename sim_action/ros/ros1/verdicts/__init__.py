"""The judgement of a launch: from its files and its output to one outcome per test."""
