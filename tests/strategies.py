"""Random programs and sketches for property tests; everything they make is legal."""

from hypothesis import strategies as st

from p3i.grammar.ast import Affine, CameraPose, Coordinate, Draw, For, Header, If, Polar, Program
from p3i.grammar.leaves import leaves
from p3i.grammar.sketch import Hole, Sketch, template

numbers = st.one_of(
    st.integers(-100, 100).map(float),
    st.sampled_from([0.0, 1.0, -1.0, 0.1, -57.0, 18.7, 1e-9, 1e16, 1e22, 1.7976931348623157e308, 5e-324]),
    st.floats(allow_nan=False, allow_infinity=False),
)
tame_numbers = st.one_of(st.integers(-20, 20).map(float), st.floats(-50, 50).map(lambda x: round(x, 3) + 0.0))

reaching_numbers = st.one_of(
    tame_numbers,
    st.builds(lambda head, power: head * 10.0**power, st.floats(-9.9, 9.9), st.integers(-320, 307)),
)
"""Any size between the least and the greatest double: what two numbers in range make may leave it."""

_values = st.recursive(
    st.one_of(
        st.builds(
            lambda sign, digit, count: f"{sign}{digit * count}",
            st.sampled_from(["", "-"]),
            st.sampled_from("19"),
            st.sampled_from([1, 4, 7, 30, 308, 309, 310, 4300, 4301]),
        ),
        st.sampled_from(["0x" + "f" * 300, "1e308", "1e309", "-0.0", "5e-324", "inf", "nan", "true", '""']),
        st.sampled_from(["1979-05-27", "07:32:00", "'a\\b'", '"\\u0000"', '"\\ud800"', "1_0"]),
        st.integers().map(str),
        st.floats().map(repr),
    ),
    lambda inner: st.lists(inner, max_size=3).map(lambda some: f"[{', '.join(some)}]"),
    max_leaves=4,
)


@st.composite
def header_texts(draw: st.DrawFn) -> str:
    """A header block that is TOML, or nearly: known keys and others, with values of any kind and size."""
    keys = st.sampled_from(["version", "canvas", "focal", "lens_k1", "image", "fit", "fit.score", "other"])
    lines = [f"# {key} = {draw(_values)}\n" for key in draw(st.lists(keys, max_size=5))]
    table = "# [fit]\n" + "".join(
        f"# {draw(keys)} = {draw(_values)}\n" for _ in range(draw(st.integers(0, 2)))
    )
    return "# /// p3p\n" + "".join(lines) + draw(st.sampled_from(["", table])) + "# ///\n"


_comment_characters = st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\u2028\u2029")
comments = st.lists(
    st.text(_comment_characters, max_size=12)
    .map(lambda text: f"# {text}".rstrip())
    .filter(lambda comment: comment not in {"# /// p3p", "# ///"}),
    max_size=2,
).map(tuple)

pictures = st.none() | st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=8
)


@st.composite
def affines(draw: st.DrawFn, variables: str = "ij", *, number=numbers) -> Affine:
    return Affine(
        draw(number) if "i" in variables else 0.0, draw(number) if "j" in variables else 0.0, draw(number)
    )


@st.composite
def coordinates(draw: st.DrawFn, variables: str, *, number=numbers, polar: bool | None = None) -> Coordinate:
    if polar is None:
        polar = draw(st.booleans())
    if not polar:
        return draw(affines(variables, number=number))
    radius, angle, offset = (draw(affines(variables, number=number)) for _ in range(3))
    return Polar(draw(st.sampled_from(["Cos", "Sin"])), radius, angle, offset)


@st.composite
def headers(draw: st.DrawFn) -> Header:
    text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=8)
    facts = st.dictionaries(
        text, st.one_of(text, st.booleans(), st.integers(-(2**62), 2**62), numbers), max_size=3
    )
    return Header(
        1,
        draw(st.none() | st.tuples(st.integers(1, 9000), st.integers(1, 9000))),
        draw(st.none() | st.floats(1, 500)),
        draw(st.none() | text),
        tuple(draw(facts).items()),
        comments=draw(comments),
    )


@st.composite
def programs(draw: st.DrawFn, *, number=numbers, header: bool = True, remarks: bool = True) -> Program:
    """Any legal program: loops `i` and `j`, one of them or none, guards, both kinds of coordinates."""
    loops = draw(st.sampled_from(["ij", "ij", "i", "j", ""]))
    ring_on_top = loops == "j" and draw(st.booleans())  # an unbound i reads as 1 there
    in_coordinates = "ij" if ring_on_top else loops
    polar = True if ring_on_top else None
    remark = comments if remarks else st.just(())
    x, y = (draw(coordinates(in_coordinates, number=number, polar=polar)) for _ in "xy")
    statement: Draw | If | For = Draw(x, y, draw(pictures) if remarks else None, comments=draw(remark))
    for _ in range(draw(st.integers(0, 3))):
        statement = If(draw(affines(loops, number=number)), statement, comments=draw(remark))
    for variable in reversed(loops):
        if variable == "i":
            start, stop = (Affine(constant=float(draw(st.integers(-9, 9)))) for _ in range(2))
        else:
            outer = "i" if "i" in loops or ring_on_top else ""
            start, stop = (draw(affines(outer, number=number)) for _ in range(2))
        statement = For(variable, start, stop, statement, comments=draw(remark))
    camera = CameraPose(draw(number), draw(number), comments=draw(remark))
    return Program(camera, statement, draw(st.none() | headers()) if header else None, draw(remark))


@st.composite
def table1_programs(draw: st.DrawFn) -> Program:
    """Any program that Table 1 derives."""
    number = numbers
    ring = draw(st.booleans())
    if ring:

        def coordinate(function: str) -> Polar:
            grows = draw(st.booleans())
            radius = Affine(i=draw(number)) if grows else Affine(constant=draw(number))
            return Polar(function, radius, Affine(j=draw(number)), Affine(constant=draw(number)))

        world = For(
            "j", Affine(i=draw(number)), Affine(i=draw(number)), Draw(coordinate("Cos"), coordinate("Sin"))
        )
        if draw(st.booleans()):
            return Program(CameraPose(draw(number), draw(number)), world)
    else:
        statement: Draw | If = Draw(Affine(draw(number), draw(number)), Affine(draw(number), draw(number)))
        for _ in range(draw(st.integers(0, 3))):
            statement = If(Affine(draw(number), draw(number)), statement)
        world = For("j", *(Affine(constant=float(draw(st.integers(-99, 99)))) for _ in range(2)), statement)
    bounds = (Affine(constant=float(draw(st.integers(-(10**17), 10**17)))) for _ in range(2))
    return Program(CameraPose(draw(number), draw(number)), For("i", *bounds, world))


@st.composite
def sketches(draw: st.DrawFn) -> Sketch:
    """A program with some of its numbers made holes; names are spared, which text tests cover."""
    program = draw(programs(number=tame_numbers))
    chosen = draw(st.lists(st.sampled_from(_open_paths(program)), unique=True, max_size=4))
    holes = []
    for path in leaves(program):
        if path not in chosen:
            continue
        whole = path.startswith("for_")
        value = st.integers(-9, 9).map(float) if whole else tame_numbers
        kind = draw(st.sampled_from(["free", "bounds", "start"]))
        lower, upper = sorted((draw(value), draw(value))) if kind == "bounds" else (None, None)
        holes.append(Hole(path, None, lower, upper, draw(value) if kind == "start" else None, whole))
    return Sketch(template(program, holes), tuple(holes))


def _open_paths(program: Program) -> list[str]:
    """The paths whose number may be a hole: not the coefficient of a variable that is out of scope there."""
    names = [path for path in leaves(program)]
    bound: set[str] = set()
    found: list[str] = []
    ring_on_top = (
        isinstance(program.world, For)
        and program.world.variable == "j"
        and isinstance(program.world.body, Draw)
        and isinstance(program.world.body.x, Polar)
        and isinstance(program.world.body.y, Polar)
    )
    for path in names:
        last = path.rpartition(".")[2]
        if path.startswith("camera.") or last == "1" or last in bound or (ring_on_top and last == "i"):
            found.append(path)
        if path.endswith("stop.1"):
            bound.add(path.partition(".")[0].removeprefix("for_"))
    return found
