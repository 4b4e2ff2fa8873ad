"""SDF files (sdformat.org/spec, versions 1.3 to 1.12) -> drafts of robots; `conversion.py` is the entry point."""
