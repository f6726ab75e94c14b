"""Channels of the camera as a map fits them: readings, mean curve and parameters of each.

A reading of the record is that of the mono picture: green, of a colour camera. In another channel
it has the light of the window there, in proportion, with every correction of the run. The white
tile, which is taken as equally reflecting in all channels, tells their responses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.results.maps.cell_brdf import pixel_variance
from acquisition.results.maps.kept_cells import CellLight, CellSource
from acquisition.results.maps.mean_curve import MeanCurve
from acquisition.results.maps.u_shared import UnknownHeight, u_shared
from acquisition.results.reduction import Reduced
from analysis.sample_maps.block_fit import CellData
from instrument.config.load import Loaded
from instrument.devices import CHANNELS, GREEN
from instrument.errors import InputError
from instrument.geometry import BoolArray, FloatArray
from instrument.record.reading import Reading
from instrument.record.record import Record

ALL = tuple(range(len(CHANNELS)))
_LEAST_SHARE = 1e-9  # of the light of the mono picture: a channel may see none
_OF_ALL = "sigma_deg"  # the parameter that channels have in common


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel: K readings with its signal, its mean curve, and the names of its parameters.

    suffix: of albedo and ks; empty for a camera of one channel. u_response: relative u of its
    response, by the noise of the tile's readings.
    """

    readings: Sequence[Reading]
    curve: MeanCurve
    suffix: str = ""
    u_response: float = 0.0

    def name(self, parameter: str) -> str:
        """Return the name of a parameter of the model in the map."""
        return parameter if parameter == _OF_ALL else parameter + self.suffix


@dataclass(frozen=True, slots=True)
class Run:
    """Run whose channels are wanted; kept: (N,), True for the K points that are mapped."""

    record: Record
    loaded: Loaded
    source: CellSource
    reduced: Reduced
    kept: BoolArray

    @property
    def readings(self) -> list[Reading]:
        """The readings (K) that are mapped."""
        return [p for p, own in zip(self.reduced.points, self.kept, strict=True) if own]


def channels_of_run(run: Run, lights: Sequence[CellLight], green: MeanCurve) -> list[Channel]:
    """Return the three channels of a run with a colour camera and a white tile.

    lights: of the mapped readings, by channel. green: mean curve of the mono picture. Raises
    `InputError` where the tile's readings were not kept or are saturated, and `NotDetermined` as
    `MeanCurve.of` does.
    """
    readings = run.readings
    tiles = _tiles(run, {r.lamp_setting for r in readings})
    responses, u = _responses(run, tiles)
    windows = np.array([light.window for light in lights])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = windows / windows[GREEN]
    # Where markers are not seen there is no window, and cells have no value.
    share = np.where(np.isfinite(share), share, 1.0)
    share = np.where(np.abs(share) < _LEAST_SHARE, _LEAST_SHARE, share)
    settings = list(tiles)
    at = [settings.index(r.lamp_setting) for r in readings]
    found = []
    for n, name in enumerate(CHANNELS):
        own = [
            replace(r, signal_dn=r.signal_dn * q)
            for r, q in zip(readings, share[n].tolist(), strict=True)
        ]
        brdf = run.reduced.brdf.copy()
        brdf[run.kept] *= share[n] / responses[at, n]
        curve = green
        if n != GREEN:
            curve = MeanCurve.of(replace(run.reduced, brdf=brdf), run.loaded, green.fit.model)
        found.append(Channel(own, curve, f"_{name}", float(u[n])))
    return found


def _tiles(run: Run, settings: set[int]) -> dict[int, Reading]:
    """Return the tile's first reading at each setting of the lamp, by its number."""
    first: dict[int, Reading] = {}
    for reading in run.record.readings():
        if reading.kind == "tile" and reading.lamp_setting in settings:
            first.setdefault(reading.lamp_setting, reading)
    lost = [r.step for r in first.values() if r.step not in run.source.steps()]
    if lost:
        raise InputError(
            f"{run.record.folder}: nothing was kept of the white tile at step {lost[0]}, which "
            "tells the response of each channel: put the files back into the run's folder"
        )
    return first


def _responses(run: Run, tiles: Mapping[int, Reading]) -> tuple[FloatArray, FloatArray]:
    """Return the responses (T, 3) of the channels at T settings of the lamp, and relative u (3,).

    That of green is 1.
    """
    readings = list(tiles.values())
    windows = run.source.tile_windows(readings)
    for reading, own in zip(readings, windows, strict=True):
        if not np.all(own > 0):
            dark = " and ".join(
                c for c, dn in zip(CHANNELS, own.tolist(), strict=True) if not dn > 0
            )
            raise InputError(
                f"{run.record.folder}: the white tile at step {reading.step} shows no light in "
                f"the channel {dark}: saturated, or dark; allowed: some in all of them"
            )
    floor, per_dn = pixel_variance(np.array([r.frames for r in readings]), run.loaded)
    pixels = np.array([max(r.window_pixels, 1.0) for r in readings])[:, np.newaxis]
    variance = (floor[:, np.newaxis] + per_dn[:, np.newaxis] * windows) / pixels
    u = np.sqrt(np.mean(variance / windows**2, axis=0))
    u[GREEN] = 0.0  # in the reading of the tile itself
    return windows / windows[:, GREEN : GREEN + 1], u


def shared_by_channels(
    channels: Sequence[Channel],
    maps: Mapping[str, FloatArray],
    data: Sequence[CellData],
    height: UnknownHeight,
    u_light: FloatArray,
) -> dict[str, FloatArray]:
    """Return u (rows, columns) of each parameter of the map, in its unit, by all that cells share.

    data: cells of each channel. u_light: (rows, columns), relative, of the light of each cell. An
    error that all share moves sigma alike in all channels.
    """
    found: dict[str, list[FloatArray]] = {}
    for channel, own in zip(channels, data, strict=True):
        names = {channel.name(p): maps[channel.name(p)] for p in channel.curve.values}
        by_parameter = {p: maps[channel.name(p)] for p in channel.curve.values}
        u = u_shared(by_parameter, channel.curve, own, height)
        # All light of a place counts alike: it is taken for albedo, and for ks.
        relative = np.hypot(u_light, channel.u_response)
        for parameter, values in u.items():
            name = channel.name(parameter)
            linear = parameter != _OF_ALL
            total = np.hypot(values, relative * np.abs(names[name])) if linear else values
            found.setdefault(name, []).append(total)
    return {name: np.asarray(np.mean(each, axis=0)) for name, each in found.items()}


def mean_values(channels: Sequence[Channel]) -> dict[str, tuple[float, float | None]]:
    """Return value and u, in its unit, of each parameter of the map in the mean curves.

    sigma: the mean over the channels, whose errors are nearly the same.
    """
    found: dict[str, list[tuple[float, float | None]]] = {}
    for channel in channels:
        for parameter, value in channel.curve.values.items():
            pair = value, channel.curve.fit.u[parameter]
            found.setdefault(channel.name(parameter), []).append(pair)
    return {name: _mean(pairs) for name, pairs in found.items()}


def _mean(pairs: Sequence[tuple[float, float | None]]) -> tuple[float, float | None]:
    if len(pairs) == 1:
        return pairs[0]
    values, us = zip(*pairs, strict=True)
    known = [u for u in us if u is not None]
    return float(np.mean(values)), float(np.mean(known)) if len(known) == len(us) else None
