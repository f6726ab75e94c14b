"""Motors of other control systems, as EPICS, through ophyd-async; read `stage.py` first."""
