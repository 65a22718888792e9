"""The header block: TOML in comments, kept as it was written."""

import dataclasses

import pytest
import strategies
from hypothesis import given, settings

import p3i
from p3i.grammar.ast import Header
from p3i.grammar.header import header_lines

BODY = (
    "SetCameraPose(rx=1, ry=2)\nfor i in range(0, 3):\n    for j in range(0, 3):\n"
    "        Draw(x=9*i, y=9*j)\n"
)
BLOCK = """\
# /// p3p
# version = 1
# canvas = [640, 480]      # width, height
# focal = 28
# image = "tiles.jpg"
#
# [fit]
# structure = "lattice"
# score = 0.87
# ///
"""


def test_the_block_is_read() -> None:
    assert p3i.loads(BLOCK + BODY).header == Header(
        canvas=(640, 480), focal_mm=28, image="tiles.jpg", fit=(("structure", "lattice"), ("score", 0.87))
    )


def test_the_block_stays_as_it_was_written() -> None:
    text = "# Above.\n" + BLOCK + "# Below.\n" + BODY
    assert p3i.format(text) == text


def test_unknown_keys_stay_and_warn() -> None:
    text = BLOCK.replace("# focal = 28\n", '# focal = 28\n# colours = ["red", { a = 1 }]\n') + BODY
    assert p3i.format(text) == text
    assert [(found.code, found.severity) for found in p3i.check(text)] == [("P119", "warning")]


def test_a_changed_header_is_printed_anew() -> None:
    program = p3i.loads(BLOCK + BODY)
    assert program.header is not None
    changed = dataclasses.replace(program, header=dataclasses.replace(program.header, canvas=(800, 600)))
    assert "# canvas = [800, 600]\n" in p3i.dumps(changed)
    assert p3i.loads(p3i.dumps(changed)) == changed


@given(strategies.headers())
@settings(deadline=None, max_examples=60)
def test_a_printed_header_reads_back(header: Header) -> None:
    text = "".join(f"{line}\n" for line in header_lines(header)) + BODY
    assert p3i.loads(text).header == header


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("# version = 2", "`version`"),
        ("# version = true", "`version`"),
        ("# canvas = [640, 0]", "`canvas`"),
        ("# canvas = [640, 480.5]", "`canvas`"),
        ("# canvas = [true, true]", "`canvas`"),
        ("# focal = 0", "`focal`"),
        ("# focal = inf", "`focal`"),
        ("# focal = nan", "`focal`"),
        ('# image = ""', "`image`"),
        ("# fit = 3", "`fit`"),
        ("# fit = { at = 2020-01-01 }", "`fit`"),
        ("# = 3", "not TOML"),
        ("#version = 1", "starts with `# `"),
        ("# a = " + "[" * 5000, "not TOML"),
        ("# a = 1\n# a = 2", "not TOML"),
        ("# /// p3p", "one header block"),
    ],
)
def test_a_wrong_header_is_an_error_at_its_line(line: str, said: str) -> None:
    text = f"# /// p3p\n{line}\n# ///\n{BODY}"
    with pytest.raises(p3i.ProgramError, match="P118") as raised:
        p3i.loads(text)
    assert said in str(raised.value)


def test_a_comment_beside_a_statement_never_becomes_a_header() -> None:
    with pytest.raises(p3i.ProgramError, match="above the first statement"):
        p3i.loads(BODY.replace("ry=2)\n", "ry=2) # /// p3p\n# ///\n"))


def test_the_lens_is_read_and_written() -> None:
    program = p3i.loads(BLOCK.replace("# focal = 28\n", "# focal = 28\n# lens_k1 = -0.08\n") + BODY)
    assert program.header is not None and program.header.lens_k1 == -0.08
    bent = dataclasses.replace(program.header, lens_k1=0.1, lines=())
    assert "# lens_k1 = 0.1" in header_lines(bent)
    assert p3i.loads(p3i.format(dataclasses.replace(program, header=bent))).header == bent


@pytest.mark.parametrize("k1", ["0.4", "-1", '"barrel"', "true", "nan"])
def test_a_lens_that_cannot_be_is_refused(k1: str) -> None:
    text = BLOCK.replace("# focal = 28\n", f"# lens_k1 = {k1}\n") + BODY
    assert [found.code for found in p3i.check(text)] == ["P118"]
