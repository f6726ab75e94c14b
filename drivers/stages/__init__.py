"""Motor stages in degrees; each maker has a framing module (bytes) and a stage module.

Start with `motor_stage`, which has the safety rules that all of them share.
"""
