"""What goes wrong: with what is run, or with asking this executor to run it."""

from __future__ import annotations


class UnsupportedFeature(Exception):
    """The action or workflow uses something that this executor does not know, or that GitHub would not take."""


class StepFailed(Exception):
    """A step that fails as it would on GitHub; the text is what its log says."""
