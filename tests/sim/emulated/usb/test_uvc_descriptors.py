"""UVC descriptors: every length, total, count and link, read by the positions of the tables."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from sim.emulated.usb import descriptors
from sim.emulated.usb.descriptors import CS_INTERFACE
from sim.emulated.usb.uvc_descriptors import (
    Format,
    Frame,
    Probe,
    configuration,
    guid,
    interval,
)

PX = st.integers(1, 8192)
INTERVALS = st.lists(st.integers(1, 10**8), min_size=1, max_size=8, unique=True).map(tuple)
FRAMES = st.lists(st.builds(Frame, PX, PX, INTERVALS), min_size=1, max_size=6).map(tuple)
CODES = st.sampled_from([("Y16 ", 16), ("Y800", 8), ("YUY2", 16), ("Y10 ", 16)])
FORMATS = st.lists(
    st.tuples(CODES, FRAMES).map(lambda drawn: Format(*drawn[0], drawn[1])), min_size=1, max_size=4
)
VIDEO_CONTROL, VIDEO_STREAMING = 1, 2  # subclasses of interfaces


def number(raw: bytes, begin: int, size: int) -> int:
    return int.from_bytes(raw[begin : begin + size], "little")


def sections(raw: bytes) -> dict[int, list[bytes]]:
    """Class-specific descriptors, whole, by the subclass of their interface."""
    found: dict[int, list[bytes]] = {}
    subclass = 0
    for kind, fields in descriptors.split(raw):
        if kind == descriptors.INTERFACE:
            subclass = fields[4]
        elif kind == CS_INTERFACE:
            found.setdefault(subclass, []).append(bytes([len(fields) + 2, kind]) + fields)
    return found


@settings(max_examples=30)
@given(FORMATS, st.sets(st.integers(0, 18)), st.sets(st.integers(0, 15)))
def test_lengths_totals_and_links(
    formats: list[Format], camera: set[int], processing: set[int]
) -> None:
    raw = configuration(formats, camera, processing)
    assert number(raw, 2, 2) == len(raw)
    assert descriptors.interfaces(raw) == ((14, 1, 0), (14, 2, 0))
    header, terminal, unit, output = sections(raw)[VIDEO_CONTROL]
    assert number(header, 3, 2) == 0x0110
    assert number(header, 5, 2) == len(header + terminal + unit + output)
    assert (header[11], header[12]) == (1, 1)  # one streaming interface, number 1
    assert number(terminal, 4, 2) == 0x0201
    assert len(terminal) == 15 + terminal[14]
    assert number(terminal, 15, terminal[14]) == sum(2**bit for bit in camera)
    assert len(unit) == 10 + unit[7]  # UVC 1.1 has bmVideoStandards
    assert number(unit, 8, unit[7]) == sum(2**bit for bit in processing)
    assert (unit[4], output[7]) == (terminal[3], unit[3])  # sources
    assert number(output, 4, 2) == 0x0101
    assert sections(raw)[VIDEO_STREAMING][0][8] == output[3]  # bTerminalLink
    assert descriptors.endpoints(raw) == {sections(raw)[VIDEO_STREAMING][0][6]}


@settings(max_examples=30)
@given(FORMATS)
def test_every_format_size_and_rate(formats: list[Format]) -> None:
    header, *rest = sections(configuration(formats, [], []))[VIDEO_STREAMING]
    assert header[3] == len(formats)
    assert number(header, 4, 2) == len(header) + sum(map(len, rest))
    assert len(header) == 13 + header[3] * header[12]
    for index, video in enumerate(formats, 1):
        described, *rest = rest
        assert (len(described), described[2], described[3]) == (27, 4, index)
        assert described[4] == len(video.frames)
        assert described[5:21] == guid(video.code)
        assert described[21] == video.bits_per_pixel
        for place, frame in enumerate(video.frames, 1):
            one, *rest = rest
            assert (one[2], one[3]) == (5, place)
            check_frame(one, video, frame)
    assert rest == []


def check_frame(raw: bytes, video: Format, frame: Frame) -> None:
    assert (number(raw, 5, 2), number(raw, 7, 2)) == (frame.width_px, frame.height_px)
    size = frame.width_px * frame.height_px * video.bits_per_pixel // 8
    assert number(raw, 17, 4) == size
    count = raw[25]
    assert (count, len(raw)) == (len(frame.intervals), 26 + 4 * count)
    listed = [number(raw, 26 + 4 * i, 4) for i in range(count)]
    assert listed == sorted(frame.intervals)
    assert number(raw, 21, 4) == frame.intervals[0]  # default
    assert 0 <= number(raw, 9, 4) <= number(raw, 13, 4)  # bit rates


def test_format_identifiers_by_the_documents() -> None:
    """YUY2 of the Uncompressed Payload document; Y800 and Y16 as in Linux's uvcvideo."""
    assert guid("YUY2").hex() == "5955593200001000800000aa00389b71"
    assert guid("Y800").hex() == "5938303000001000800000aa00389b71"
    assert guid("Y16 ").hex() == "5931362000001000800000aa00389b71"


@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_the_choice_of_a_stream_round_trips(video: int, frame: int, period: int) -> None:
    raw = Probe(video, frame, period, 614400, 16384).pack()
    assert len(raw) == 34  # 4.3.1.1
    assert Probe.parse(raw) == Probe(video, frame, period)
    assert (number(raw, 18, 4), number(raw, 22, 4)) == (614400, 16384)


def test_intervals_count_100_ns() -> None:
    assert [interval(rate) for rate in (30, 15, 5, 1)] == [333333, 666667, 2000000, 10000000]
