"""The statistics of gates and of paired comparisons: pure functions of counts and numbers."""
