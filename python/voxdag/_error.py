"""The exception of this package, and the type of its paths."""

import os
from typing import Union

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]


class Error(Exception):
    """What went wrong, where, and what was expected.

    `code` is one of the names in docs/errors.md, such as "invalid_input", "corrupt" or "no_space".
    """

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code
