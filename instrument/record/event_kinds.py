"""Kinds of events in the run record: the words of column `kind` in table `event`.

They are stored in files and therefore never change.
"""

from typing import Final

OPERATOR: Final = "operator"  # a prompt and the answer to it
DRIFT: Final = "drift"  # a drift check at a resume, and its outcome
RETRY: Final = "retry"  # a warning of a driver: an exchange was repeated, a frame discarded
TROUBLE: Final = "trouble"  # an error of a driver that did not end the scan
EXPOSURE: Final = "exposure"  # counts at two exposures, compared
LATENCY: Final = "latency"  # between camera and axis, found for frames of an axis that turns
HOT: Final = "hot pixels"  # left out of the window's mean, with their positions
PLATE: Final = "plate"  # where markers show the plate that carries the sample
INTERLOCK: Final = "interlock"  # a measurement contradicts the physics: what was done about it
STOPPED: Final = "stopped"  # the operator ended the scan
FAULT: Final = "fault"  # a device or the disk ended the scan
RESUMED: Final = "resumed"  # the scan continued
DAMAGED: Final = "damaged"  # rows that changed on the disk were removed, to be replaced
CHOSEN: Final = "chosen"  # the steps that the scan measures next, and why: `reading.Batch`
FINISHED: Final = "finished"  # the last step was accepted
