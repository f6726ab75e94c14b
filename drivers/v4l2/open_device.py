"""Opening a V4L2 camera by OpenCV and setting its picture, all of it read back by request.

OpenCV reports success for a substitute format and for another size. Format, size and number of
buffers each restart the stream, so they come before the controls.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.v4l2 import ioctl as v4l2
from drivers.v4l2.settings import V4l2Settings
from instrument.errors import CameraLost, DeviceError

if TYPE_CHECKING:
    from cv2 import VideoCapture

CABLE = "look at the USB cable, at the camera and at the computer, and at the hub between"
_LEAST_BUFFERS = 2


def lost(who: str, error: OSError) -> CameraLost:
    """What to say of a camera that no longer answers."""
    return CameraLost(
        f"{who}: is gone ({os.strerror(error.errno or 0)}), unplugged or without power; {CABLE}; "
        "the next try opens the camera anew"
    )


def open_control(settings: V4l2Settings) -> int:
    """A descriptor for questions and controls, beside the one that OpenCV streams on."""
    try:
        return os.open(settings.device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise CameraLost(
            f"camera {settings.device}: cannot be opened ({os.strerror(error.errno or 0)}); {CABLE}"
            ", and that the rig file names a device that `gonio devices` lists"
        ) from error


def open_video(settings: V4l2Settings, control: int, who: str) -> tuple[VideoCapture, int | None]:
    """OpenCV's capture, set to the picture, and the descriptor that it streams on, if found."""
    # In whole seconds, and read once: the least that ends a wait for a dead stream.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
    import cv2

    before = _descriptors()
    video = cv2.VideoCapture(settings.device, cv2.CAP_V4L2)
    try:
        if not video.isOpened():
            v4l2.capability(control)
            raise CameraLost(
                f"{who}: is there, but OpenCV cannot open it: no buffers, or no format that OpenCV "
                "knows; look whether another program uses the camera, or plug it in anew"
            )
        _set_picture(video, settings)
        stream = _stream_descriptor(before, control)
        _check_picture(video, settings, control, who)
        _check_buffers(video, stream, who)
    except BaseException:
        video.release()
        raise
    return video, stream


def _set_picture(video: VideoCapture, settings: V4l2Settings) -> None:
    import cv2

    video.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    video.set(cv2.CAP_PROP_FOURCC, v4l2.fourcc(settings.pixel_format))
    video.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width_px)
    video.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px)
    if settings.frames_per_s is not None:
        video.set(cv2.CAP_PROP_FPS, settings.frames_per_s)
    video.set(cv2.CAP_PROP_BUFFERSIZE, settings.buffers)


def _check_picture(video: VideoCapture, settings: V4l2Settings, control: int, who: str) -> None:
    import cv2

    found = v4l2.current_format(control)
    if found.name != settings.pixel_format:
        offered = ", ".join(v4l2.formats(control))
        raise DeviceError(
            f"{who}: format {settings.pixel_format} asked for, the camera took {found.name}; "
            f"it offers {offered}; change pixel_format"
        )
    _check_size(found, settings, control, who)
    if video.get(cv2.CAP_PROP_CONVERT_RGB) != 0:
        raise DeviceError(
            f"{who}: OpenCV would convert {found.name} to 8-bit colour; use OpenCV 4.14 or later"
        )
    _check_rate(settings, control, who)


def _check_size(found: v4l2.Format, settings: V4l2Settings, control: int, who: str) -> None:
    if (found.width_px, found.height_px) != (settings.width_px, settings.height_px):
        offered = ", ".join(v4l2.sizes(control, found.name))
        raise DeviceError(
            f"{who}: size {settings.width_px} x {settings.height_px} pixels asked for, the camera "
            f"took {found.width_px} x {found.height_px}; it offers {offered}; "
            "change width_px and height_px"
        )
    if found.bytes_per_line != settings.bytes_per_line:
        raise DeviceError(
            f"{who}: a row has {found.bytes_per_line} bytes, {settings.bytes_per_line} of them "
            "pixels: OpenCV would shear the picture; choose another width_px"
        )


def _check_rate(settings: V4l2Settings, control: int, who: str) -> None:
    asked, period_s = settings.frames_per_s, v4l2.frame_period_s(control)
    if asked is not None and period_s is not None and period_s > 1.01 / asked:
        raise DeviceError(
            f"{who}: {asked} frames a second asked for, the camera took {1 / period_s:g}; "
            "change frames_per_s or the size"
        )


def _check_buffers(video: VideoCapture, stream: int | None, who: str) -> None:
    count = buffer_count(video)
    given = count if stream is None else _buffers_given(stream, count)
    if given < _LEAST_BUFFERS:
        raise CameraLost(
            f"{who}: gave {given} buffers, at least {_LEAST_BUFFERS} are needed; look whether "
            "another program uses the camera, or plug it in anew"
        )


def buffer_count(video: VideoCapture) -> int:
    """How many buffers OpenCV has of the camera."""
    import cv2

    return int(video.get(cv2.CAP_PROP_BUFFERSIZE))


def _buffers_given(stream: int, count: int) -> int:
    try:
        return len([v4l2.buffer_state(stream, index) for index in range(count)])
    except OSError:
        return 0


def _descriptors() -> set[int]:
    return {int(entry.name) for entry in Path("/proc/self/fd").iterdir()}


def _stream_descriptor(before: set[int], control: int) -> int | None:
    """The descriptor on which this camera answers, best one that came with the opening.

    A number from before may have been closed by another thread and used anew.
    """
    camera = v4l2.capability(control)
    for descriptor in sorted(_descriptors() - {control}, key=lambda one: one in before):
        try:
            if v4l2.capability(descriptor) == camera:
                return descriptor
        except OSError:
            continue  # another file of this process
    return None
