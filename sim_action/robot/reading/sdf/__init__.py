"""SDF files (sdformat.org/spec, versions 1.3 to 1.12) -> drafts of robots; `robots.py` is the entry point."""
