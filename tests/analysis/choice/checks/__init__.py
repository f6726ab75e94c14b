"""Tests of the checks of the data: their false alarms on sound data, and what they find."""
