"""The exception of this package, and the type of its paths."""

import operator
import os
from typing import Any, Union

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]

_MAX_THREADS = 1024


class Error(Exception):
    """The problem, the place and the expectation.

    `code` is one of the names in docs/errors.md, such as "invalid_input", "corrupt" or "no_space".
    """

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles message and code, so that another process can send the error."""
        return type(self), (str(self), self.code)


def path_text(path: Path) -> str:
    """Returns the path as text, or raises Error if no file can have it."""
    text = os.fsdecode(path)
    try:
        os.fsencode(text)
        usable = "\0" not in text
    except UnicodeEncodeError:
        usable = False
    if not usable:
        raise Error(f"the path {text!r}: expected a path that a file can have", "invalid_input")
    return text


def memory_text(memory: Union[int, str, None]) -> str:
    """A limit of memory, "" for the default."""
    return "" if memory is None else str(memory)


def thread_count(threads: int) -> int:
    """A number of threads, 0 for all."""
    if not 0 <= operator.index(threads) <= _MAX_THREADS:
        raise Error(f"threads={threads}: expected 0 (all) to {_MAX_THREADS}", "invalid_input")
    return operator.index(threads)
