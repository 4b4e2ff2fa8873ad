"""Trained networks of policies (ONNX): the check before a run, and sessions that run them.

This folder needs only `core`, because a process for each network imports it.
"""
