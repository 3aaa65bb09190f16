"""The exceptions and warnings of this package, and checks of arguments that several functions
share."""

import errno
import operator
import os
import sys
import warnings
from typing import Any, Union

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]

_MAX_THREADS = 1024


class Error(Exception):
    """The exception that the functions of this package raise. Its message names the problem, the
    place of the problem and the expected value.

    code   one of the names in docs/errors.md, such as "invalid_input", "corrupt" or "no_space"

    For these codes, the error is also an instance of a built-in exception:

    invalid_input, limit   ValueError
    not_found              FileNotFoundError
    io, no_space           OSError, or PermissionError if the system denied the permission
    out_of_memory          MemoryError
    device                 RuntimeError
    """

    code: str

    def __new__(cls, message: str, code: str) -> "Error":
        chosen = _type_of(message, code) if cls is Error else cls
        if chosen is not cls:
            return chosen(message, code)
        base = OSError if issubclass(cls, OSError) else Exception
        return base.__new__(cls, message)

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code

    def __str__(self) -> str:
        return str(self.args[0])

    def __reduce__(self) -> tuple[Any, ...]:
        """Lets pickle keep the message and the code, to send the error between processes."""
        return Error, (str(self), self.code)


class _InvalidError(Error, ValueError):
    pass


class _NotFoundError(Error, FileNotFoundError):
    pass


class _SystemError(Error, OSError):
    pass


class _DeniedError(Error, PermissionError):
    pass


class _MemoryError(Error, MemoryError):
    pass


class _DeviceError(Error, RuntimeError):
    pass


_TYPES: dict[str, type[Error]] = {
    "invalid_input": _InvalidError,
    "limit": _InvalidError,
    "not_found": _NotFoundError,
    "io": _SystemError,
    "no_space": _SystemError,
    "out_of_memory": _MemoryError,
    "device": _DeviceError,
}
for _type in {*_TYPES.values(), _DeniedError}:
    _type.__name__ = _type.__qualname__ = "Error"  # as tracebacks show it


def _type_of(message: str, code: str) -> type[Error]:
    denied = (os.strerror(errno.EACCES), os.strerror(errno.EPERM))
    if code == "io" and message.endswith(denied):
        return _DeniedError
    return _TYPES.get(code, Error)


def stack_level() -> int:
    """Returns the `stacklevel` with which the caller's warning names the line that called this
    package."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__package__") == __package__:
        level, frame = level + 1, frame.f_back
    return level


def warn(message: str) -> None:
    """Issues a UserWarning for the line that called this package. The native module calls this
    function for its warnings."""
    warnings.warn(message, UserWarning, stacklevel=stack_level())


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
