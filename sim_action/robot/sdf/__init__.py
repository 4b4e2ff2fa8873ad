"""SDF files (sdformat.org/spec, versions 1.4 to 1.11) -> URDF documents; `conversion.py` is the entry point."""
