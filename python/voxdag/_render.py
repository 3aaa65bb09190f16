"""Renders pictures of finished .vdag files."""

import math
import operator
from typing import Any, Optional, Union

import numpy as np

from . import _native
from ._error import Error, Path, memory_text, path_text
from ._progress import Progress, shown
from ._types import Bytes

_MAX_EDGE = 16384  # pixels
_BACKGROUNDS = ("sky", "white", "transparent")
_SHADES = ("color", "sharing", "level", "normal")


def render(
    path: Path,
    *,
    view: str = "auto",
    camera: Optional[Any] = None,
    target: Optional[Any] = None,
    fov: Optional[float] = None,
    size: tuple[int, int] = (1280, 720),
    samples: int = 2,
    background: str = "sky",
    shade: str = "color",
    gray: bool = False,
    memory: Union[int, str, None] = None,
    threads: int = 0,
    progress: Progress = None,
) -> Bytes:
    """Renders the picture that the command `voxdag render` writes, and returns its pixels.

    The result is an array (height, width, 3) of uint8: red, green and blue in sRGB, with the upper
    row first. With a transparent background, its shape is (height, width, 4), and the last channel
    is alpha.

    view             name of the camera's view: "auto", "iso", "front", "back", "left", "right",
                     "top" or "inside". "auto" is "inside" if most of the scene cannot be seen from
                     outside, otherwise "iso".
    camera, target   position of the camera and of the point at the center of the picture, each as
                     x, y, z in the units of the scene. They replace the view.
    fov              vertical field of view, from 1 to 170 degrees. The default depends on the view;
                     with a camera, it is 50 degrees.
    size             width and height in pixels, each at most 16384
    samples          number of samples along each edge of a pixel, from 1 to 8. A pixel is the mean
                     of samples * samples samples.
    background       color of pixels that show no surface: "sky", "white" or "transparent"
    shade            what the colors of surfaces show: "color" (the scene's colors), "sharing" (how
                     often equal parts of the DAG occur), "level" (the levels of the visible cells)
                     or "normal" (the normals)
    gray             if True, ignores the colors of the file
    memory           memory limit, as a number of bytes or as text such as "8GiB". The default is
                     half of the machine's memory. A picture needs 66 bytes per pixel, or 68 with a
                     transparent background.
    threads          number of threads; 0 means all cores. The pixels do not depend on it.
    progress         as in build()

    Raises Error if an argument is invalid, if the picture needs more than `memory`, or if the file
    cannot be read.
    """
    width, height = _size(size)
    if (camera is None) != (target is None):
        given = "target" if camera is None else "camera"
        raise Error(f"only a {given}: expected a camera and a target, or neither", "invalid_input")
    if not isinstance(view, str):
        raise Error(
            f"view {view!r}: expected the name of a view, such as 'iso' or 'top'", "invalid_input"
        )
    if camera is not None and view != "auto":
        raise Error(f"a camera and the view {view!r}: expected one of them", "invalid_input")
    degrees = None if fov is None else _number(fov)
    if degrees is not None and not 1 <= degrees <= 170:
        raise Error(f"fov {fov!r}: expected 1 to 170 degrees", "invalid_input")
    if background not in _BACKGROUNDS:
        raise Error(
            f"background {background!r}: expected one of {', '.join(_BACKGROUNDS)}", "invalid_input"
        )
    if shade not in _SHADES:
        raise Error(f"shade {shade!r}: expected one of {', '.join(_SHADES)}", "invalid_input")
    if not isinstance(gray, (bool, np.bool_)):
        raise Error(f"gray {gray!r}: expected True or False", "invalid_input")
    samples = _whole(samples, 1, 8, f"samples {samples!r}: expected 1 to 8")
    threads = _whole(threads, 0, 1 << 16, f"threads {threads!r}: expected 0 (all) to {1 << 16}")
    place = None if camera is None else _point(camera, "camera")
    aim = (0.0, 0.0, 0.0) if target is None else _point(target, "target")
    file = path_text(path)
    _native.check_render_memory(file, width, height, background, shade, memory_text(memory))
    pixels = np.empty((height, width, 4 if background == "transparent" else 3), np.uint8)
    with shown(progress) as callback:
        _native.render(
            file,
            view,
            place,
            aim,
            degrees,
            samples,
            background,
            shade,
            bool(gray),
            threads,
            callback,
            pixels,
        )
    return pixels


def _number(value: Any) -> float:
    """Returns the value as a float, or NaN if it is not a number."""
    try:
        return float(value) if np.ndim(value) == 0 and not isinstance(value, str) else math.nan
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _whole(value: Any, least: int, most: int, expected: str) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise Error(expected, "invalid_input") from None
    if not least <= number <= most:
        raise Error(expected, "invalid_input")
    return number


def _size(size: Any) -> tuple[int, int]:
    expected = f"size {size!r}: expected a width and a height of 1 to {_MAX_EDGE} pixels"
    try:
        width, height = size
    except (TypeError, ValueError):
        raise Error(expected, "invalid_input") from None
    return _whole(width, 1, _MAX_EDGE, expected), _whole(height, 1, _MAX_EDGE, expected)


def _point(point: Any, what: str) -> tuple[float, float, float]:
    try:
        numbers = np.asarray(point, np.float64)
    except (TypeError, ValueError):
        raise Error(f"the {what} {point!r}: expected x, y, z", "invalid_input") from None
    if numbers.shape != (3,) or not np.all(np.isfinite(numbers)):
        raise Error(f"the {what} {point!r}: expected x, y, z, all finite", "invalid_input")
    x, y, z = numbers.tolist()
    return x, y, z
