"""Live page of messages that a test writes, instead of a scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from acquisition.live.address import address, listening_socket, port_of
from acquisition.live.channel import PICTURE_FILE, STATE_FILE
from acquisition.live.following.board import Board
from acquisition.live.web.app import Shown, live_app
from acquisition.live.web.server import WebServer
from tests.support.live.messages import Content
from tests.support.live.pages import TOKEN


@dataclass(frozen=True, slots=True)
class MessagePage:
    """Its address, the board of its messages, and the channel's folder."""

    address: str
    board: Board
    channel: Path

    def tell(self, kind: str, content: Content) -> None:
        """Send a message; those about a point or an event replace that of the same number only."""
        key = f"{kind} {content.get('step', content.get('number'))}"
        self.board.put(key if kind in ("point", "happened") else kind, kind, content)

    def tell_picture(self, number: int) -> None:
        """Send a picture of 40 x 30 pixels whose window has its corners at (10, 5) and (29, 24)."""
        jpeg = cv2.imencode(".jpg", np.full((30, 40), 120, dtype=np.uint8))[1].tobytes()
        corners = [[10, 5], [29, 5], [29, 24], [10, 24]]
        content: Content = {
            "number": number, "step": number, "caption": f"picture {number}", "exposure_s": 0.0123,
            "peak_dn": 3711, "full_scale_dn": 4095, "saturated_pixels": 7,
            "window_saturated_pixels": 2, "window_mean_dn": 2800.1, "sharpness": 0.4,
            "width_px": 40, "height_px": 30, "outline": corners,
        }  # fmt: skip
        self.channel.mkdir(exist_ok=True)
        (self.channel / PICTURE_FILE).write_bytes(jpeg)
        (self.channel / STATE_FILE).write_text(json.dumps({"picture": content}))
        self.tell("picture", content)


@contextmanager
def message_page(folder: Path, port: int = 0) -> Iterator[MessagePage]:
    """Serve the page, in a `with` block."""
    board = Board()
    with listening_socket(port) as listener:
        app = live_app(Shown(board, folder / "channel", None), TOKEN, port_of(listener))
        with WebServer(app, listener):
            yield MessagePage(address(listener, TOKEN), board, folder / "channel")
            board.close()
