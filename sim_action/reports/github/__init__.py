"""The reports that GitHub Actions shows: job summary, annotations, step outputs."""
