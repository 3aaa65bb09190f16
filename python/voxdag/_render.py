"""Pictures of finished files."""

import os
from typing import Any, Optional, Tuple

import numpy as np

from . import _native
from ._build import Progress
from ._error import Error, Path

_MAX_EDGE = 16384  # pixels


def render(path: Path, *, view: str = "auto", camera: Optional[Any] = None,
           target: Optional[Any] = None, fov: Optional[float] = None,
           size: Tuple[int, int] = (1280, 720), samples: int = 2, gray: bool = False,
           threads: int = 0, progress: Optional[Progress] = None) -> np.ndarray:
    """A picture of a .vdag file as voxdag render makes it: sRGB, (height, width, 3) uint8.

    view             auto, iso, front, back, left, right, top or inside
    camera, target   instead of a view: where the camera is and what it looks at, in scene units
    fov              vertical field of view, 1 to 170 degrees
    size             width and height in pixels
    samples          N: N * N samples per pixel, 1 to 8
    gray             leave out the colors that the file may have

    The pixels do not depend on threads. Raises Error.
    """
    width, height = size
    if not 1 <= width <= _MAX_EDGE or not 1 <= height <= _MAX_EDGE:
        raise Error(f"size {size!r}: expected a width and a height of 1 to {_MAX_EDGE} pixels",
                    "invalid_input")
    if (camera is None) != (target is None):
        raise Error("expected a camera and a target, or neither", "invalid_input")
    if camera is not None and view != "auto":
        raise Error(f"a camera and the view {view!r}: expected one of them", "invalid_input")
    if fov is not None and not 1 <= fov <= 170:
        raise Error(f"fov {fov!r}: expected 1 to 170 degrees", "invalid_input")
    if not 1 <= samples <= 8:
        raise Error(f"samples {samples!r}: expected 1 to 8", "invalid_input")
    pixels = np.empty((height, width, 3), np.uint8)
    _native.render(os.fsdecode(path), view, None if camera is None else _point(camera, "camera"),
                   (0.0, 0.0, 0.0) if target is None else _point(target, "target"),
                   None if fov is None else float(fov), samples, gray, threads, progress, pixels)
    return pixels


def _point(point: Any, what: str) -> Tuple[float, float, float]:
    numbers = np.asarray(point, np.float64)
    if numbers.shape != (3,):
        raise Error(f"the {what} {point!r}: expected x, y, z", "invalid_input")
    x, y, z = numbers.tolist()
    return x, y, z
