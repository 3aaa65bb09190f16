"""Converts colors of meshes and points to sRGB with 8 bits per channel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._error import Error


def byte_colors(given: ArrayLike, rows: int, what: str) -> NDArray[np.uint8]:
    """Converts colors to an array (rows, 4) of uint8. `given` has 3 or 4 channels: integers from 0
    to 255, or floats from 0 to 1. It can be a single color for all rows. `what` is its name in
    error messages."""
    colors = np.asarray(given)
    if colors.shape in ((3,), (4,)):
        colors = np.broadcast_to(colors, (rows, len(colors)))
    if colors.shape not in ((rows, 3), (rows, 4)) or colors.dtype.kind not in "fiu":
        raise Error(
            f"{what} is an array {colors.shape} of {colors.dtype}: expected ({rows}, 3) or "
            f"({rows}, 4), uint8 or floats from 0 to 1",
            "invalid_input",
        )
    full = 1 if colors.dtype.kind == "f" else 255
    if colors.size and not (colors.min() >= 0 and colors.max() <= full):
        bad = np.flatnonzero(~((colors >= 0) & (colors <= full)).all(axis=1))[0]
        raise Error(
            f"{what}[{bad}] is {colors[bad].tolist()}: expected numbers from 0 to {full}",
            "invalid_input",
        )
    out = np.full((rows, 4), 255, np.uint8)
    out[:, : colors.shape[1]] = np.rint(colors * 255) if full == 1 else colors
    return out


def tinted(pixels: NDArray[np.uint8], factor: Any) -> NDArray[np.uint8]:
    """Multiplies an image, (height, width, 3 or 4) in sRGB, by a factor (red, green, blue, alpha)
    in linear light, as glTF does with the base color factor."""
    factors = np.asarray(factor, np.float64)
    if np.all(factors[:3] == 1):
        return pixels
    out = pixels.copy()
    levels = _linear_of(np.arange(256) / 255)
    for channel in range(3):
        table = np.rint(255 * srgb_of(levels * factors[channel])).astype(np.uint8)
        out[:, :, channel] = table[pixels[:, :, channel]]
    return out


def _linear_of(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb_of(linear: ArrayLike) -> NDArray[np.float64]:
    """Converts numbers from 0 to 1 in linear light to sRGB."""
    value = np.clip(np.asarray(linear, np.float64), 0, 1)
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055)
