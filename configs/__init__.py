"""Protocols and rigs that ship with the program: `protocols/*.yaml`, `rigs/*.yaml`.

A package, so that `importlib.resources.files("configs")` finds them in an installed program too.
Start with `protocols/demo.yaml`; `rigs/paper_1995.yaml` explains every entry of a rig file.
"""
