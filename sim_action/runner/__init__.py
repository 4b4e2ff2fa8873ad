"""Execution of many scenarios: planning, child processes, repetitions and engine agreement."""
