"""The exception of this package, and checks of arguments that several functions have."""

import operator
import os
from typing import Any, Union

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]

_MAX_THREADS = 1024


class Error(Exception):
    """An error of this package. The text names the problem, the place and the expected value.

    `code` is one of the names in docs/errors.md, such as "invalid_input", "corrupt" or "no_space".
    """

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code

    def __reduce__(self) -> tuple[Any, ...]:
        """Lets pickle keep the message and the code, to send the error between processes."""
        return type(self), (str(self), self.code)


def path_text(path: Path) -> str:
    """Returns a path as text. Raises Error if no file can have this path."""
    text = os.fsdecode(path)
    try:
        os.fsencode(text)
        usable = "\0" not in text
    except UnicodeEncodeError:
        usable = False
    if not usable:
        raise Error(
            f"the path {text!r}: expected text without NUL that the file system can encode",
            "invalid_input",
        )
    return text


def memory_text(memory: Union[int, str, None]) -> str:
    """Returns a memory limit in the form that the native module expects; "" is its default."""
    return "" if memory is None else str(memory)


def thread_count(threads: int) -> int:
    """Returns `threads` as an int; 0 means all cores. Raises Error if the number is not allowed."""
    if not 0 <= operator.index(threads) <= _MAX_THREADS:
        raise Error(f"threads={threads}: expected 0 (all) to {_MAX_THREADS}", "invalid_input")
    return operator.index(threads)
