"""What notebooks show: the escaped text and a drawing that stands in the page by itself."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import p3i
from p3i.notebook import program_html, result_html
from p3i.search.result import StopReason, SynthesisResult

TEXT = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 4):
    for j in range(0, 3):
        Draw(x=8*i - 12, y=8*j - 8)
"""


def svg_in(html: str) -> ElementTree.Element:
    (found,) = re.findall(r"<svg.*</svg>", html, flags=re.DOTALL)
    return ElementTree.fromstring(found)


def test_a_program_shows_its_text_and_a_drawing_without_scripts_or_links() -> None:
    html = program_html(p3i.loads(TEXT))
    assert "range(0, 4)" in html
    ellipses = svg_in(html).findall(".//{http://www.w3.org/2000/svg}ellipse")
    assert len(ellipses) == 12
    assert "<script" not in html and "href" not in html


def test_the_text_is_escaped() -> None:
    html = program_html(p3i.loads("# <script>alert(1)</script>\n" + TEXT))
    assert "<script>" not in html
    assert "&lt;script&gt;alert(1)" in html
    svg_in(html)


def test_a_guard_is_readable_in_the_text() -> None:
    assert "i &gt;= 1" in program_html(p3i.loads(TEXT.replace("Draw", "if i >= 1: Draw")))


def test_a_huge_program_is_not_drawn_into_the_page() -> None:
    html = program_html(p3i.loads(TEXT.replace("range(0, 4)", "range(0, 4000)")))
    assert "<svg" not in html and "12,000 draws" in html


def test_a_picture_that_is_gone_costs_the_drawing_only() -> None:
    html = program_html(p3i.loads(TEXT.replace("Draw(", 'Draw("gone.png", ')))
    assert "gone.png" in html and "<pre" in html and "<svg" not in html


def test_a_result_shows_its_facts_and_its_program() -> None:
    result = SynthesisResult(
        program=p3i.loads(TEXT),
        stop=StopReason.FOUND,
        structure="lattice",
        score=0.71,
        margin=0.2,
        centers=((1.0, 2.0, 0, 0),),
        notes=("a < b",),
    )
    html = result_html(result)
    assert "lattice, 1 objects, score 0.71, margin 0.20" in html
    assert "a &lt; b" in html and "SetCameraPose" in html


def test_a_result_without_a_program_says_why() -> None:
    html = result_html(SynthesisResult(program=None, stop=StopReason.NO_PATTERN, agreement=0.02, needed=0.13))
    assert html == "<p>no regular pattern (best 0.02, needs 0.13)</p>"


# What p3i needs of IPython, as IPython 9 has it (IPython.core.formatters.BaseFormatter).
IPYTHON = """
import sys, types

class Formatter:
    def __init__(self):
        self.shown, self.by_name = {}, {}
    def for_type(self, kind, show):
        self.shown[kind] = show
    def for_type_by_name(self, module, name, show):
        self.by_name[module, name] = show
    def __call__(self, value):
        kind = type(value)
        show = self.shown.get(kind) or self.by_name.get((kind.__module__, kind.__qualname__))
        return show and show(value)

html = Formatter()
shell = types.SimpleNamespace(display_formatter=types.SimpleNamespace(formatters={"text/html": html}))
ipython = sys.modules["IPython"] = types.ModuleType("IPython")
ipython.get_ipython = lambda: shell
import p3i
"""


def python(code: str) -> None:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_in_ipython_programs_and_answers_are_drawn_and_nothing_heavy_loads_before() -> None:
    python(
        IPYTHON
        + "program = p3i.loads('Draw(x=1, y=2)'); assert 'numpy' not in sys.modules\n"
        + "assert '<svg' in html(program); assert 'numpy' in sys.modules\n"
        + "from p3i.search.result import StopReason, SynthesisResult\n"
        + "assert 'too small' in html(SynthesisResult(program=None, stop=StopReason.TOO_SMALL))\n"
        + "assert html(3) is None"
    )


def test_an_ipython_without_a_shell_is_none_of_our_business() -> None:
    python(IPYTHON.replace("lambda: shell", "lambda: None") + "assert not html.shown")
    python(IPYTHON.replace("ipython.get_ipython = lambda: shell", "") + "assert not html.shown")


def test_without_ipython_the_notebook_is_not_loaded() -> None:
    python("import sys, p3i; p3i.loads('Draw(x=1, y=2)'); assert 'p3i.notebook' not in sys.modules")
