"""An option that a function does not have is refused by name, before anything is read or searched."""

import inspect

import pytest

import p3i
from p3i import api
from p3i.errors import UsageError

FUNCTIONS = [
    name
    for name in api.__all__
    if inspect.isfunction(getattr(api, name)) and getattr(api, name).__module__.startswith("p3i.api.")
]


def test_the_commands_are_among_the_functions() -> None:
    assert {"synth", "score", "eval_set", "examples", "trace", "edit", "read_image"} <= set(FUNCTIONS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_an_unknown_option_is_a_usage_error_that_names_those_there_are(name: str) -> None:
    function = getattr(p3i, name)
    needed = [
        "nowhere"
        for parameter in inspect.signature(function).parameters.values()
        if parameter.default is parameter.empty
        and parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD)
    ]
    with pytest.raises(UsageError, match=rf"^{name} has no option 'foo'; it has \w+"):
        function(*needed, foo=1)
