"""Tables in the format of the CUReT database, and a folder with them."""

from __future__ import annotations

# Directions: camera on the lamp's side; mirror; grazing, printed past pi/2; 0.3 and 1.2 rad.
TABLE = """\
1  0.500000  -1.570796  0.400000  -1.570796
2  0.400000   3.141593  0.400000   0.000000
3  1.570797   0.500000  0.000000   0.000000
4  0.300000   1.000000  1.200000   0.250000
"""

VALUES = """\
1  0.200  0.100  0.000  0.050
2  0.300 -0.010  0.250  0.125
7  0.000 -0.010 -0.010  0.000
"""
