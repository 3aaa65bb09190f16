"""Checks of arrays that several functions take."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ._error import Error


def rows_of(values: ArrayLike, dtype: DTypeLike, what: str) -> NDArray[Any]:
    """Converts the argument with the name `what` to a contiguous array (N, 3) of `dtype`. A single
    row x, y, z is allowed. Raises Error for any other shape, for values that are not numbers, and
    for floats if `dtype` is int64."""
    array = np.asarray(values)
    if array.ndim == 1 and array.shape == (3,):
        array = array.reshape(1, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise Error(f"the {what} are an array {array.shape}: expected (N, 3)", "invalid_input")
    if dtype == np.int64 and array.dtype.kind not in "iu":
        raise Error(
            f"{what} has the dtype {array.dtype}: expected an integer dtype, int8 to int64 or "
            "uint8 to uint64 (a float dtype requires world=True)",
            "invalid_input",
        )
    if array.dtype.kind not in "fiu":
        raise Error(
            f"{what} has the dtype {array.dtype}: expected a float dtype, such as float64, or an "
            "integer dtype, int8 to int64 or uint8 to uint64",
            "invalid_input",
        )
    if dtype == np.int64 and array.dtype == np.uint64 and (array >> np.uint64(63)).any():
        raise Error(
            f"the {what} have the coordinate {array.max()}: expected less than 2^63",
            "invalid_input",
        )
    return np.ascontiguousarray(array, dtype=dtype)
