"""Decompresses LAZ files, which the native module does not read, to LAS files."""

from __future__ import annotations

import contextlib
import errno
import importlib
import os
from collections.abc import Iterator, Sequence

from ._error import Error

# Maximum number of points in memory.
_CHUNK_POINTS = 1_000_000
# The header of a LAS file has its point format at this offset. LASzip sets the high bits.
_POINT_FORMAT = 104
_COMPRESSED = 0xC0


@contextlib.contextmanager
def decompressed(files: Sequence[str], folder_prefix: str) -> Iterator[list[str]]:
    """Provides the list `files`, in which temporary LAS files replace the LAZ files. Removes the
    temporary files at the end. File number i has the name `folder_prefix` + "i.las", so that a
    repeated build finds files with the same names."""
    temporary: list[str] = []
    try:
        yield [_las_of(file, f"{folder_prefix}{i}.las", temporary) for i, file in enumerate(files)]
    finally:
        for file in temporary:
            with contextlib.suppress(FileNotFoundError):
                os.remove(file)


def _las_of(file: str, las: str, temporary: list[str]) -> str:
    if not _is_laz(file):
        return file
    temporary.append(las)
    _decompress(file, las)
    return las


def _is_laz(file: str) -> bool:
    try:
        with open(file, "rb") as stream:
            head = stream.read(_POINT_FORMAT + 1)
    except OSError:
        return False  # the build reports it
    return len(head) > _POINT_FORMAT and head[:4] == b"LASF" and head[-1] & _COMPRESSED != 0


def _decompress(file: str, las: str) -> None:
    try:
        laspy = importlib.import_module("laspy")
    except ImportError:
        raise Error(
            f"{file}: is a compressed LAZ file, and a module to read it is missing: "
            "pip install 'laspy[lazrs]'",
            "invalid_input",
        ) from None
    try:
        with (
            laspy.open(file) as reader,
            laspy.open(las, mode="w", header=reader.header, do_compress=False) as writer,
        ):
            for points in reader.chunk_iterator(_CHUNK_POINTS):
                writer.write_points(points)
    except OSError as error:
        code = "no_space" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "io"
        raise Error(f"{file}: cannot be decompressed: {error}", code) from error
    except Exception as error:  # laspy and its decoders have many types of exceptions
        raise Error(f"{file}: cannot be decompressed: {error}", "invalid_input") from error
