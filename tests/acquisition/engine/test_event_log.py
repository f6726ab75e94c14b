"""Event log: messages of any thread are written to the record by the one that owns it."""

from __future__ import annotations

import logging
from threading import Thread

from acquisition.engine.event_log import log_to_record
from instrument.record.record import Record


def test_messages_become_events_in_order_and_errors_are_kept_to_be_shown(record: Record) -> None:
    log = logging.getLogger("drivers.stages.newport")
    with log_to_record(record) as handler:
        log.info("nobody needs this")
        thread = Thread(target=log.warning, args=("theta_r: asked %s", "again"))
        thread.start()
        thread.join()
        log.error("lamp: stuck")
        assert not list(record.events())
        handler.write()
    log.warning("after the scan")
    handler.write()
    assert [(kind, text) for _, kind, text in record.events()] == [
        ("retry", "theta_r: asked again"),
        ("trouble", "lamp: stuck"),
    ]
    assert handler.troubles == ["lamp: stuck"]
