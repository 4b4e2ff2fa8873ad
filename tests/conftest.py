"""Property tests ask the same questions on every run, and never how long an answer took."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

settings.register_profile("sim-action", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("sim-action")
