"""Completes the documentation that help() shows."""

from __future__ import annotations

from typing import Any, Callable, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


def lists_options(options: type) -> Callable[[_Function], _Function]:
    """Returns a decorator that appends the list of options in the docstring of `options` to the
    docstring of a function."""

    def decorate(function: _Function) -> _Function:
        listed = (options.__doc__ or "").partition("\n\n")[2]
        function.__doc__ = (function.__doc__ or "").rstrip() + "\n\n" + listed
        return function

    return decorate
