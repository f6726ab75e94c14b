"""Configuration: rig and protocol files in YAML, as frozen pydantic models.

Open `rig` and `protocol` first, which state what a file may hold; `load` reads the files and
reports every mistake with its place.
"""
