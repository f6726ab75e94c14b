"""Procedures that calibrate a rig: plan, measurement with the rig's devices, evaluation, file.

Open `procedure` first. Nothing here moves an axis.
"""
