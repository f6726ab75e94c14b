"""Facts that a report shows beside the values. Open `lamp_levels.py` or `input_files.py`."""
