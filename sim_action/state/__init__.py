"""Plain data of a run: commands, observations, readings, traces and golden trajectories."""
