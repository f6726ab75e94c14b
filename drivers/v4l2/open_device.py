"""Open a V4L2 camera with OpenCV and set its image format; every setting is read back.

OpenCV reports success even if the camera took another format or size. Format, size and number of
buffers each restart the stream, so they are set before the controls.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.v4l2 import ioctl
from drivers.v4l2.settings import BUFFERS, V4l2Settings
from instrument.errors import CameraLost, WrongRigFile

if TYPE_CHECKING:
    from cv2 import VideoCapture

CHECK_USB = "look at the USB cable, at the camera and at the computer, and at the hub between"
_MIN_BUFFERS = 2


def camera_lost(who: str, error: OSError) -> CameraLost:
    """Return the error for a camera that no longer answers."""
    return CameraLost(
        f"{who}: is gone ({os.strerror(error.errno or 0)}), unplugged or without power; "
        f"{CHECK_USB}; the next attempt reopens the camera"
    )


def open_control(settings: V4l2Settings) -> int:
    """Open a descriptor for queries and controls, beside the one that OpenCV streams on."""
    try:
        return os.open(settings.device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise CameraLost(
            f"camera {settings.device}: cannot be opened ({os.strerror(error.errno or 0)}); "
            f"{CHECK_USB}, and that the rig file names a device that `gonio devices` lists"
        ) from error


def require_pictures(found: ioctl.Capability, device: str, who: str) -> None:
    """Raise if a node is not for pictures; a USB camera has a second node, for metadata."""
    if found.captures:
        return
    first = device.removesuffix("-video-index1") + "-video-index0"
    advice = first if device.endswith("-video-index1") else "one that `gonio devices` lists"
    raise WrongRigFile(f"{who}: this node is {found.purpose}; name {advice} in the rig file")


def open_video(settings: V4l2Settings, control: int, who: str) -> tuple[VideoCapture, int | None]:
    """Return OpenCV's capture, set and checked, and the descriptor that it streams on, if found."""
    # In whole seconds, and read once: the shortest wait for a dead stream.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
    import cv2

    before = _descriptors()
    video = cv2.VideoCapture(settings.device, cv2.CAP_V4L2)
    try:
        if not video.isOpened():
            ioctl.capability(control)
            raise CameraLost(
                f"{who}: is there, but OpenCV cannot open it: no buffers, or no format that OpenCV "
                "knows; look whether another program uses the camera, or plug it in again"
            )
        _set_format(video, settings)
        stream = _stream_descriptor(before, control)
        _check_format(video, settings, control, who)
        _check_buffers(video, stream, who)
    except BaseException:
        video.release()
        raise
    return video, stream


def _set_format(video: VideoCapture, settings: V4l2Settings) -> None:
    import cv2

    video.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    video.set(cv2.CAP_PROP_FOURCC, ioctl.fourcc(settings.pixel_format))
    video.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width_px)
    video.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px)
    if settings.frames_per_s is not None:
        video.set(cv2.CAP_PROP_FPS, settings.frames_per_s)
    video.set(cv2.CAP_PROP_BUFFERSIZE, BUFFERS)


def _check_format(video: VideoCapture, settings: V4l2Settings, control: int, who: str) -> None:
    import cv2

    found = ioctl.current_format(control)
    if found.name != settings.pixel_format:
        offered = ", ".join(ioctl.formats(control))
        raise WrongRigFile(
            f"{who}: format {settings.pixel_format} asked for, the camera took {found.name}; "
            f"it offers {offered}; change pixel_format"
        )
    _check_size(found, settings, control, who)
    if video.get(cv2.CAP_PROP_CONVERT_RGB) != 0:
        raise WrongRigFile(
            f"{who}: OpenCV would convert {found.name} to 8-bit colour; use OpenCV 4.14 or later"
        )
    _check_range(found, settings, who)
    _check_rate(settings, control, who)


def _check_range(found: ioctl.Format, settings: V4l2Settings, who: str) -> None:
    if found.limited_range == settings.limited_range:
        return
    if found.limited_range:
        raise WrongRigFile(
            f"{who}: its {found.name} has limited range: black is 16 and white 235, so counts "
            "never come to 255 and saturation would not be seen; write luma_range: limited and a "
            "black_level_dn of at least 16 in the rig file, or use another pixel_format"
        )
    raise WrongRigFile(
        f"{who}: its {found.name} has the full range, 0 to 255, but the rig file says luma_range: "
        "limited; remove that entry"
    )


def _check_size(found: ioctl.Format, settings: V4l2Settings, control: int, who: str) -> None:
    if (found.width_px, found.height_px) != (settings.width_px, settings.height_px):
        offered = ", ".join(ioctl.sizes(control, found.name))
        raise WrongRigFile(
            f"{who}: size {settings.width_px} x {settings.height_px} pixels asked for, the camera "
            f"took {found.width_px} x {found.height_px}; it offers {offered}; "
            "change width_px and height_px"
        )
    if found.bytes_per_line != settings.bytes_per_line:
        raise WrongRigFile(
            f"{who}: a row has {found.bytes_per_line} bytes, {settings.bytes_per_line} of them "
            "pixels: OpenCV would shear the image; choose another width_px"
        )


def _check_rate(settings: V4l2Settings, control: int, who: str) -> None:
    asked, period_s = settings.frames_per_s, ioctl.frame_period_s(control)
    if asked is not None and period_s is not None and period_s > 1.01 / asked:
        raise WrongRigFile(
            f"{who}: {asked} frames a second asked for, the camera took {1 / period_s:g}; "
            "change frames_per_s or the size"
        )


def _check_buffers(video: VideoCapture, stream: int | None, who: str) -> None:
    count = buffer_count(video)
    given = count if stream is None else _usable_buffers(stream, count)
    if given < _MIN_BUFFERS:
        raise CameraLost(
            f"{who}: gave {given} buffers, at least {_MIN_BUFFERS} are needed; look whether "
            "another program uses the camera, or plug it in again"
        )


def buffer_count(video: VideoCapture) -> int:
    """Return the number of buffers that OpenCV has of the camera."""
    import cv2

    return int(video.get(cv2.CAP_PROP_BUFFERSIZE))


def _usable_buffers(stream: int, count: int) -> int:
    try:
        return len([ioctl.buffer_state(stream, index) for index in range(count)])
    except OSError:
        return 0


def _descriptors() -> set[int]:
    return {int(entry.name) for entry in Path("/proc/self/fd").iterdir()}


def _stream_descriptor(before: set[int], control: int) -> int | None:
    """Return the descriptor on which this camera answers; those that are new come first.

    Another thread may have closed a descriptor meanwhile, and OpenCV been given its number.
    """
    camera = ioctl.capability(control)
    for descriptor in sorted(_descriptors() - {control}, key=lambda number: number in before):
        try:
            if ioctl.capability(descriptor) == camera:
                return descriptor
        except OSError:
            continue  # another file of this process
    return None
