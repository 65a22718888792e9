"""Options made from an annotated record: what click then takes, says and gives back."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import click
import pytest
from click.testing import CliRunner

import p3i
from p3i.cli import grouped, options
from p3i.errors import UsageError
from p3i.records import Spelt


def parse_pair(text: str) -> tuple[int, int]:
    first, second = text.split(":")
    return int(first), int(second)


RECORDS = [getattr(p3i, name) for name in p3i.__all__ if name.endswith(("Options", "Config"))]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    colour: Annotated[Literal["red", "blue"], "A colour."] = "red"
    many: Annotated[int, "How many.", Spelt(metavar="N")] = 3
    seconds_s: Annotated[float | None, "How long.", Spelt("--seconds")] = None
    open_wide: Annotated[bool, "Whether open."] = True
    lit: Annotated[bool | None, "Whether lit."] = None
    bright: Annotated[bool, "Whether bright.", Spelt("--bright/--dark")] = False
    file: Annotated[Path | None, "A file."] = None
    word: Annotated[str, "A word."] = "so"
    focal: Annotated[float | Literal["auto"] | None, "A length.", Spelt(metavar="MM|auto")] = None
    lens: Annotated[float | Literal["auto"] | None, "A bend.", Spelt(none="none")] = 0.5
    pair: Annotated[tuple[int, int], "Two.", Spelt(metavar="A:B", read=parse_pair)] = (1, 1)

    def __post_init__(self) -> None:
        if self.many > 100:
            raise UsageError("too many")


def read(*words: str, declare: Any = None) -> Sample:
    """The record that the command line `words` makes; raises click's errors."""
    found: list[Sample] = []

    @grouped.command("sample")
    @(declare or options.of(Sample))
    def command(**given: Any) -> None:
        found.append(options.chosen(Sample, given))

    command.main(list(words), standalone_mode=False)
    return found[0]


def help_of(*decorators: Any) -> str:
    def body(**given: Any) -> None: ...

    for decorator in reversed(decorators):
        body = decorator(body)
    command = grouped.command("sample")(click.argument("photo", metavar="PHOTO")(body))
    return CliRunner().invoke(command, ["--help"]).output


def test_no_words_make_the_record_of_all_defaults() -> None:
    assert read() == Sample()


def test_each_kind_of_field_is_read_from_its_own_option() -> None:
    words = "--colour blue --many 7 --seconds 1.5 --no-open-wide --no-lit --bright --file a/b.txt --word x"
    found = read(*words.split(), "--focal", "28", "--lens", "none", "--pair", "3:4")
    assert found == Sample(
        colour="blue",
        many=7,
        seconds_s=1.5,
        open_wide=False,
        lit=False,
        bright=True,
        file=Path("a/b.txt"),
        word="x",
        focal=28.0,
        lens=None,
        pair=(3, 4),
    )


def test_a_number_beside_a_word_takes_either() -> None:
    assert read("--focal", "AUTO").focal == "auto"
    assert read("--lens", "-0.2").lens == -0.2
    with pytest.raises(click.BadParameter, match="'none' is neither a number nor auto"):
        read("--focal", "none")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--colour", "green"], "'red', 'blue'"),
        (["--many", "x"], "not a valid integer"),
        (["--pair", "3"], "not enough values"),
        (["--file", ""], "empty"),
        (["--word", ""], "empty"),
    ],
)
def test_a_value_of_another_kind_is_wrong_usage(words: list[str], reason: str) -> None:
    with pytest.raises(click.BadParameter, match=reason) as caught:
        read(*words)
    assert caught.value.param is not None and words[0] in caught.value.param.opts


def test_what_the_record_refuses_is_its_own_error() -> None:
    with pytest.raises(UsageError, match="too many"):
        read("--many", "101")


def test_named_fields_alone_become_options_in_their_order_and_may_be_worded_anew() -> None:
    declare = options.of(Sample, "word", "many", word={"metavar": "W"})
    with pytest.raises(click.NoSuchOption):
        read("--colour", "blue", declare=declare)
    assert read("--many", "4", declare=declare) == Sample(many=4)


def test_help_says_the_sentence_the_metavar_and_the_default_of_each_field() -> None:
    shown = " ".join(help_of(options.of(Sample)).split())
    assert "--many N How many. [default: 3]" in shown
    assert "--colour [red|blue] A colour. [default: red]" in shown
    assert "--open-wide / --no-open-wide Whether open. [default: open-wide]" in shown
    assert "--lit / --no-lit Whether lit. --bright" in shown  # no default
    assert "--focal MM|auto A length." in shown and "--lens NUMBER|auto|none A bend." in shown
    assert "--file FILE A file." in shown and "--pair A:B Two." in shown


def test_options_of_one_group_stand_under_its_title_and_the_rest_at_the_end() -> None:
    shown = help_of(
        options.quiet, grouped.group("First", options.of(Sample, "word"), options.of(Sample, "many"))
    )
    first, rest = shown.index("First:"), shown.index("General:")
    assert first < shown.index("--word") < shown.index("--many") < rest < shown.index("--quiet")
    assert "Options:" not in shown and shown.count("PHOTO") == 1


def test_a_field_whose_text_nobody_reads_is_refused_when_it_is_declared() -> None:
    @dataclass(frozen=True, slots=True)
    class Odd:
        thing: Annotated[complex, "A thing."] = 0j

    with pytest.raises(TypeError, match="thing"):
        options.of(Odd)(lambda: None)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_every_record_of_p3i_can_be_made_into_options(record: Any) -> None:
    found: list[Any] = []

    @grouped.command("sample")
    @options.of(record)
    def command(**given: Any) -> None:
        found.append(options.chosen(record, given))

    command.main([], standalone_mode=False)
    assert found == [record()]
    fields = {field.name for field in dataclasses.fields(record)}
    assert {param.name for param in command.params} == fields
