"""What notebooks show: the escaped text and a drawing that stands in the page by itself."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import p3i
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
    html = p3i.loads(TEXT)._repr_html_()
    assert "range(0, 4)" in html
    ellipses = svg_in(html).findall(".//{http://www.w3.org/2000/svg}ellipse")
    assert len(ellipses) == 12
    assert "<script" not in html and "href" not in html


def test_the_text_is_escaped() -> None:
    html = p3i.loads("# <script>alert(1)</script>\n" + TEXT)._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;alert(1)" in html
    svg_in(html)


def test_a_guard_is_readable_in_the_text() -> None:
    assert "i &gt;= 1" in p3i.loads(TEXT.replace("Draw", "if i >= 1: Draw"))._repr_html_()


def test_a_huge_program_is_not_drawn_into_the_page() -> None:
    html = p3i.loads(TEXT.replace("range(0, 4)", "range(0, 4000)"))._repr_html_()
    assert "<svg" not in html and "12,000 draws" in html


def test_a_picture_that_is_gone_costs_the_drawing_only() -> None:
    html = p3i.loads(TEXT.replace("Draw(", 'Draw("gone.png", '))._repr_html_()
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
    html = result._repr_html_()
    assert "lattice, 1 objects, score 0.71, margin 0.20" in html
    assert "a &lt; b" in html and "SetCameraPose" in html


def test_a_result_without_a_program_says_why() -> None:
    html = SynthesisResult(program=None, stop=StopReason.NO_PATTERN, score=0.02, needed=0.13)._repr_html_()
    assert html == "<p>no regular pattern (best 0.02, needs 0.13)</p>"


def test_programs_load_nothing_heavy_before_a_notebook_asks() -> None:
    code = (
        "import sys, p3i; program = p3i.loads('Draw(x=1, y=2)'); assert 'numpy' not in sys.modules;"
        "assert '<svg' in program._repr_html_(); assert 'numpy' in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
