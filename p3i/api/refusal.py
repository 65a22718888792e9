"""Functions without a record of options refuse unknown ones as those with one do: by name, as UsageError."""

import functools
import inspect
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from p3i.errors import UsageError

Given = ParamSpec("Given")
Answer = TypeVar("Answer")


def refuses_unknown(function: Callable[Given, Answer]) -> Callable[Given, Answer]:
    """`function`, which raises UsageError (not TypeError) for a keyword that it does not take."""
    known = [
        name for name, each in inspect.signature(function).parameters.items() if each.kind != each.VAR_KEYWORD
    ]

    @functools.wraps(function)
    def asked(*args: Given.args, **kwargs: Given.kwargs) -> Answer:
        if unknown := sorted(kwargs.keys() - set(known)):
            raise UsageError(f"{function.__name__} has no option {unknown[0]!r}; it has {', '.join(known)}")
        return function(*args, **kwargs)

    return asked
