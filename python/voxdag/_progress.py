"""Shows the progress of long calls."""

from __future__ import annotations

import contextlib
import importlib
import sys
import time
from collections.abc import Iterator
from typing import Any, Callable, Union

# The argument `progress` of long calls: a function, True, False or None. A function is called as
# progress(stage, done, total, unit) up to 20 times a second, on the thread of the caller. `stage`
# is the name of the current stage. `done` is the number of finished units, `total` is the number of
# all units (0 if unknown), and `unit` is the name of the units, such as "triangles". If the
# function raises an exception, the call stops and raises this exception. True shows a progress bar
# of tqdm, or prints lines to standard error if tqdm is not installed. False and None show nothing.
Progress = Union[Callable[[str, int, int, str], None], bool, None]
_Function = Callable[[str, int, int, str], None]

_TEXT_INTERVAL_S = 1.0


@contextlib.contextmanager
def shown(progress: Progress) -> Iterator[_Function | None]:
    """Provides the function that receives the progress of a call, or None if the call reports no
    progress. Closes the progress bar at the end."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        bar = _bar()
        try:
            yield bar.update
        finally:
            bar.close()
    elif callable(progress):
        yield progress
    else:
        raise TypeError(f"progress={progress!r}: expected a function, True or None")


def _bar() -> _TqdmBars | _TextLines:
    try:
        return _TqdmBars(importlib.import_module("tqdm.auto").tqdm)
    except ImportError:
        return _TextLines()


class _TqdmBars:
    """Shows a tqdm progress bar for each stage."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._stage = ""

    def update(self, stage: str, done: int, total: int, unit: str) -> None:
        if stage != self._stage or self._bar is None:
            self.close()
            self._stage = stage
            self._bar = self._tqdm(desc=stage, unit=f" {unit}", unit_scale=True)
        self._bar.total = total or None
        self._bar.n = done
        self._bar.refresh()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


class _TextLines:
    """Prints a line to standard error when a stage begins, and every second during a stage."""

    def __init__(self) -> None:
        self._stage = ""
        self._next = 0.0

    def update(self, stage: str, done: int, total: int, unit: str) -> None:
        now = time.monotonic()
        if stage == self._stage and now < self._next:
            return
        self._stage, self._next = stage, now + _TEXT_INTERVAL_S
        share = f"{done / total:.0%} of {total:,} {unit}" if total else f"{done:,} {unit}"
        print(f"voxdag: {stage}: {share}", file=sys.stderr, flush=True)

    def close(self) -> None:
        pass
