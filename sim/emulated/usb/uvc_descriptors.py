"""Descriptors and constants of a UVC 1.1 camera, by the names of their fields.

Sources: USB Device Class Definition for Video Devices 1.1, chapters 3 and 4 and appendix A;
Uncompressed Payload 1.1. The camera is a camera terminal, a processing unit and an output terminal
to the computer, and streams uncompressed frames over one bulk endpoint.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from struct import pack
from typing import NamedTuple
from uuid import UUID

from sim.emulated.usb import descriptors
from sim.emulated.usb.descriptors import BULK, CS_INTERFACE, descriptor

CONTROL_INTERFACE, STREAMING_INTERFACE = 0, 1
INTERFACE_ITSELF, CAMERA_TERMINAL, PROCESSING_UNIT, OUTPUT_TERMINAL = 0, 1, 2, 3  # entities
VIDEO_ENDPOINT = 0x81
UNITS_PER_S = 10_000_000  # of frame intervals
_VIDEO_CLASS = 0x0E
_UVC_1_1 = 0x0110
_CLOCK_HZ = 48_000_000
_MOST = 2**32 - 1  # of a field with four bytes
_BULK_PACKET = 512  # the only size of a high-speed bulk endpoint
_VIDEO_CONTROL, _VIDEO_STREAMING, _COLLECTION = 1, 2, 3  # subclasses
_VC_HEADER, _VC_INPUT_TERMINAL, _VC_OUTPUT_TERMINAL, _VC_PROCESSING_UNIT = 1, 2, 3, 5
_VS_INPUT_HEADER, _VS_FORMAT_UNCOMPRESSED, _VS_FRAME_UNCOMPRESSED = 1, 4, 5
_ITT_CAMERA, _TT_STREAMING = 0x0201, 0x0101


class Frame(NamedTuple):
    """One size of frames, with its intervals in 100 ns, the default first."""

    width_px: int
    height_px: int
    intervals: tuple[int, ...]


class Format(NamedTuple):
    """One uncompressed format. `code`: the four letters of its GUID."""

    code: str
    bits_per_pixel: int
    frames: tuple[Frame, ...]

    def frame_bytes(self, frame: Frame) -> int:
        """Return the size of a frame."""
        return frame.width_px * frame.height_px * self.bits_per_pixel // 8


def interval(frames_per_s: float) -> int:
    """Return the frame interval in 100 ns."""
    return round(UNITS_PER_S / frames_per_s)


def guid(code: str) -> bytes:
    """Return the GUID of a format that is known by four letters, as in a descriptor."""
    prefix = int.from_bytes(code.encode("ascii"), "little")
    return UUID(f"{prefix:08x}-0000-0010-8000-00aa00389b71").bytes_le


def camera_terminal(bmControls: int) -> bytes:
    """Return the descriptor of the camera terminal, without a zoom lens."""
    focal_lengths = (0, 0, 0)
    fields = (_VC_INPUT_TERMINAL, CAMERA_TERMINAL, _ITT_CAMERA, 0, 0, *focal_lengths, 3)
    return descriptor(CS_INTERFACE, "BBHBBHHHB3s", *fields, bmControls.to_bytes(3, "little"))


def processing_unit(bmControls: int, wMaxMultiplier: int = 0) -> bytes:
    """Return the descriptor of the processing unit, whose source is the camera terminal."""
    fields = (_VC_PROCESSING_UNIT, PROCESSING_UNIT, CAMERA_TERMINAL, wMaxMultiplier, 2)
    names_and_standards = (0, 0)  # iProcessing, bmVideoStandards
    controls = bmControls.to_bytes(2, "little")
    return descriptor(CS_INTERFACE, "BBBHB2sBB", *fields, controls, *names_and_standards)


def output_terminal() -> bytes:
    """Return the descriptor of the terminal that streams to the computer."""
    fields = (_VC_OUTPUT_TERMINAL, OUTPUT_TERMINAL, _TT_STREAMING, 0, PROCESSING_UNIT, 0)
    return descriptor(CS_INTERFACE, "BBHBBB", *fields)


def control_header(entities: bytes) -> bytes:
    """Return the header of the video control interface, followed by its terminals and units."""
    total = 13 + len(entities)
    fields = (_VC_HEADER, _UVC_1_1, total, _CLOCK_HZ, 1, STREAMING_INTERFACE)
    return descriptor(CS_INTERFACE, "BHHIBB", *fields) + entities


def uncompressed_frame(bFrameIndex: int, frame: Frame, size: int) -> bytes:
    """Return the descriptor of one size of frames; `size` in bytes."""
    fastest, slowest = min(frame.intervals), max(frame.intervals)
    bits = size * 8 * UNITS_PER_S
    rates = (min(bits // slowest, _MOST), min(bits // fastest, _MOST))  # bit/s
    fields = (_VS_FRAME_UNCOMPRESSED, bFrameIndex, 0, frame.width_px, frame.height_px, *rates, size)
    count = len(frame.intervals)
    intervals = (frame.intervals[0], count, *sorted(frame.intervals))
    return descriptor(CS_INTERFACE, f"BBBHHIIIIB{count}I", *fields, *intervals)


def uncompressed_format(bFormatIndex: int, video: Format) -> bytes:
    """Return the descriptor of one format, followed by those of its frames."""
    fields = (_VS_FORMAT_UNCOMPRESSED, bFormatIndex, len(video.frames), guid(video.code))
    default_frame_aspect_and_flags = (1, 0, 0, 0, 0)
    return descriptor(
        CS_INTERFACE, "BBB16sB5B", *fields, video.bits_per_pixel, *default_frame_aspect_and_flags
    ) + b"".join(
        uncompressed_frame(index, frame, video.frame_bytes(frame))
        for index, frame in enumerate(video.frames, 1)
    )


def streaming_header(formats: Sequence[Format]) -> bytes:
    """Return the input header of the streaming interface, followed by its formats."""
    body = b"".join(uncompressed_format(i, video) for i, video in enumerate(formats, 1))
    count = len(formats)
    total = 13 + count + len(body)
    still_images = (0, 0, 0)  # bStillCaptureMethod, bTriggerSupport, bTriggerUsage
    links = (VIDEO_ENDPOINT, 0, OUTPUT_TERMINAL, *still_images)
    fields = (_VS_INPUT_HEADER, count, total, *links, 1, bytes(count))
    return descriptor(CS_INTERFACE, f"BBHBBBBBBB{count}s", *fields) + body


def configuration(
    formats: Sequence[Format], camera_controls: Iterable[int], processing_controls: Iterable[int]
) -> bytes:
    """Return all descriptors of a camera; controls are given by their bits in bmControls."""
    entities = (
        camera_terminal(sum(1 << bit for bit in camera_controls))
        + processing_unit(sum(1 << bit for bit in processing_controls))
        + output_terminal()
    )
    return descriptors.configuration(
        descriptors.interface_association(
            bFirstInterface=CONTROL_INTERFACE,
            bInterfaceCount=2,
            function=(_VIDEO_CLASS, _COLLECTION, 0),
            iFunction=2,
        ),
        descriptors.interface(
            bInterfaceNumber=CONTROL_INTERFACE,
            bNumEndpoints=0,
            kind=(_VIDEO_CLASS, _VIDEO_CONTROL, 0),
            iInterface=2,
        ),
        control_header(entities),
        descriptors.interface(
            bInterfaceNumber=STREAMING_INTERFACE,
            bNumEndpoints=1,
            kind=(_VIDEO_CLASS, _VIDEO_STREAMING, 0),
        ),
        streaming_header(formats),
        descriptors.endpoint(
            bEndpointAddress=VIDEO_ENDPOINT, bmAttributes=BULK, wMaxPacketSize=_BULK_PACKET
        ),
        bNumInterfaces=2,
    )


class Probe(NamedTuple):
    """Video probe and commit control (4.3.1.1); the fields that are missing here are zero.

    bFormatIndex, bFrameIndex, dwFrameInterval (100 ns), dwMaxVideoFrameSize,
    dwMaxPayloadTransferSize.
    """

    format_index: int
    frame_index: int
    frame_interval: int
    max_frame_bytes: int = 0
    max_payload_bytes: int = 0

    def pack(self) -> bytes:
        """Return the 34 bytes of UVC 1.1; bit 0 of bmHint keeps the frame interval."""
        compression = (0, 0, 0, 0, 0)  # wKeyFrameRate … wDelay
        versions = (0, 0, 0, 0)  # bmFramingInfo, bPreferedVersion, bMinVersion, bMaxVersion
        return pack("<HBBI5HIII4B", 1, *self[:3], *compression, *self[3:], _CLOCK_HZ, *versions)

    @classmethod
    def parse(cls, data: bytes) -> Probe:
        """Return the fields that the computer chooses."""
        return cls(data[2], data[3], int.from_bytes(data[4:8], "little"))


PROBE_BYTES = 34
