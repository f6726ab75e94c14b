"""The vocabulary of the instrument: angles, devices, errors, clock, configuration, record.

Knows none of the other packages; every other package knows this one.
"""
