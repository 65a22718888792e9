"""The tree of a p3i program: frozen values, compared by what they mean.

A program is one camera line and one statement: at most one `for i` around at most one `for j`, guards
directly above the `Draw`. Coordinates are kept in normal form, `Affine` or `Polar`, so every tool can
reason about them. Spans and comments are carried along, but two programs that mean the same are equal.
Nothing outside p3i.grammar sees a lark tree.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

Variable = Literal["i", "j"]
Function = Literal["Cos", "Sin"]
FitValue = str | int | float | bool


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of the source text: character offsets, `start` included, `end` not."""

    start: int
    end: int


def _number(value: float) -> float:
    """A finite float, with -0.0 made 0.0; raises ValueError otherwise."""
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"a program holds finite numbers only, not {value}")
    return value + 0.0


def is_path(text: str) -> bool:
    """Whether a file can be called so: not empty, no NUL, no lone surrogates."""
    return bool(text) and "\0" not in text and not any("\ud800" <= mark <= "\udfff" for mark in text)


@dataclass(frozen=True, slots=True)
class Affine:
    """`i*i + j*j + constant`: a number that depends on the loop variables linearly."""

    i: float = 0.0
    j: float = 0.0
    constant: float = 0.0
    span: Span | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("i", "j", "constant"):
            object.__setattr__(self, name, _number(getattr(self, name)))


@dataclass(frozen=True, slots=True)
class Polar:
    """`radius * function(angle) + offset`, the angle in degrees; the three parts affine in i and j."""

    function: Function
    radius: Affine
    angle: Affine
    offset: Affine
    span: Span | None = field(default=None, compare=False, repr=False)


Coordinate = Affine | Polar


@dataclass(frozen=True, slots=True)
class Draw:
    """An object at plane point (x, y), in program units; `picture` is a path relative to the program."""

    x: Coordinate
    y: Coordinate
    picture: str | None = None
    span: Span | None = field(default=None, compare=False, repr=False)
    comments: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.picture is not None and not is_path(self.picture):
            raise ValueError(f"no file can have the path {self.picture!r}")


@dataclass(frozen=True, slots=True)
class If:
    """Draws only where `guard >= 0` (to within 1e-9)."""

    guard: Affine
    body: "If | Draw"
    span: Span | None = field(default=None, compare=False, repr=False)
    comments: tuple[str, ...] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class For:
    """`for variable in range(start, stop)`: whole numbers from ceil(start) up to, not with, ceil(stop)."""

    variable: Variable
    start: Affine
    stop: Affine
    body: "For | If | Draw"
    span: Span | None = field(default=None, compare=False, repr=False)
    comments: tuple[str, ...] = field(default=(), compare=False, repr=False)


Statement = For | If | Draw


@dataclass(frozen=True, slots=True)
class CameraPose:
    """The camera's tilt in degrees (frame and signs: docs/geometry.md); the focal is in the header."""

    rx_deg: float = 0.0
    ry_deg: float = 0.0
    span: Span | None = field(default=None, compare=False, repr=False)
    comments: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("rx_deg", "ry_deg"):
            object.__setattr__(self, name, _number(getattr(self, name)))


@dataclass(frozen=True, slots=True)
class Header:
    """The optional TOML block in comments; what it does not say is None.

    `canvas` is (width, height) in pixels, `focal_mm` the 35 mm-equivalent focal of docs/geometry.md,
    `image` a path relative to the program, `fit` the facts that `synth` wrote down, in order, `lens_k1` the
    radial distortion of the photo (docs/geometry.md). `lines` is the block as it was written, which the
    printer repeats as long as it says the same as the fields; `comments` stand above the block.
    """

    version: int = 1
    canvas: tuple[int, int] | None = None
    focal_mm: float | None = None
    image: str | None = None
    fit: tuple[tuple[str, FitValue], ...] = ()
    lens_k1: float | None = None
    lines: tuple[str, ...] = field(default=(), compare=False, repr=False)
    comments: tuple[str, ...] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Program:
    """A whole program. `trailing_comments` stand after the last statement."""

    camera: CameraPose
    world: Statement
    header: Header | None = None
    trailing_comments: tuple[str, ...] = field(default=(), compare=False, repr=False)
