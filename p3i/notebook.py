"""What notebooks show of a program and of an answer: the text, and a drawing in the page itself.

Where p3i is imported in IPython it tells IPython's formatter of the two (`register`): neither the grammar nor
the search knows who draws. Nothing heavy is loaded before there is something to show.
"""

from html import escape
from typing import TYPE_CHECKING, Any

from p3i.errors import P3IError
from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program

if TYPE_CHECKING:
    from p3i.search.result import SynthesisResult

_MOST_DRAWN = 2000
"""Programs of more draws than this are shown as text: the drawing would weigh more than the notebook."""
_WIDE_PX = 420


def register(ipython: Any) -> None:
    """Let the running shell of the module `ipython`, if there is one, show programs and answers as HTML."""
    shell = getattr(ipython, "get_ipython", lambda: None)()
    formatter = getattr(shell, "display_formatter", None)
    html = getattr(formatter, "formatters", {}).get("text/html")
    if html is not None:  # a plain terminal has none
        html.for_type(Program, program_html)
        html.for_type_by_name("p3i.search.result", "SynthesisResult", result_html)


def program_html(program: Program) -> str:
    """HTML of a program: its text beside its drawing, or beside the reason why there is none."""
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<pre style="margin:0">{escape(format_program(program))}</pre>{_drawing(program)}</div>'
    )


def result_html(result: "SynthesisResult") -> str:
    """HTML of an answer: its facts, and its program; the reason where there is none."""
    if result.program is None:
        return f"<p>{escape(result.reason)}</p>"
    facts = [result.structure or "", f"{len(result.centers)} objects"]
    if result.score is not None:
        facts.append(f"score {result.score:.2f}")
    if result.margin is not None:
        facts.append(f"margin {result.margin:.2f}")
    facts.append(f"focal {result.focal_mm:.4g} mm ({result.focal_source})")
    lines = [", ".join(fact for fact in facts if fact), *result.notes]
    return "".join(f"<p>{escape(line)}</p>" for line in lines) + program_html(result.program)


def _drawing(program: Program) -> str:
    """The program's drawing as an SVG element, or the reason for none as a paragraph."""
    from p3i.interp.unroll import live_indices

    try:
        count = len(live_indices(program))
        if count > _MOST_DRAWN:
            return f"<p>{count:,} draws are too many to show here: `p3i.render` draws them</p>"
        from p3i.paint.draw.render import render

        document = render(program).encode("svg").decode("utf-8")
    except P3IError as error:
        return f"<p>{escape(str(error))}</p>"
    svg = document[document.index("<svg") :].strip()
    style = f"max-width:100%;width:{_WIDE_PX}px;height:auto"
    return f'<svg style="{style}"{svg.removeprefix("<svg")}'
