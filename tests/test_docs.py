"""The documents keep up with the code: every command, option and code is written about."""

import importlib
import re
from pathlib import Path

import click
import pytest

from p3i.cli.main import COMMANDS

ROOT = Path(__file__).parent.parent
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
TEXT = {path: path.read_text(encoding="utf-8") for path in DOCUMENTS}


def command(name: str) -> click.Command:
    return importlib.import_module(COMMANDS[name].module).command


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_stands_in_the_readme(name: str) -> None:
    assert command(name).help
    assert f"`{name}" in TEXT[ROOT / "README.md"]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_documents_mention_no_option_that_a_command_lacks(name: str) -> None:
    known = {word for option in command(name).params for word in [*option.opts, *option.secondary_opts]}
    known |= {"--help", "-h"}
    for path, text in TEXT.items():
        for line in re.findall(rf"^(?:\.venv/bin/)?p3i {name}\b.*$", text, flags=re.MULTILINE):
            used = set(re.findall(r"(?<= )--[a-z][a-z-]*", line))
            assert used <= known, f"{path.name}: `{line}` uses {sorted(used - known)}"


def test_every_code_of_a_diagnostic_has_a_section_and_every_section_a_code() -> None:
    from p3i.grammar.diagnostics import CODES

    sections = set(re.findall(r"^#+ .*\b(P\d{3})\b", TEXT[ROOT / "docs" / "errors.md"], flags=re.MULTILINE))
    assert sections == set(CODES)


def test_every_exit_code_stands_in_the_documents() -> None:
    from p3i import errors

    classes = [value for value in vars(errors).values() if isinstance(value, type)]
    codes = {kind.exit_code for kind in classes if issubclass(kind, errors.P3IError)}
    listed = set(map(int, re.findall(r"^\| (\d+) \|", TEXT[ROOT / "README.md"], flags=re.MULTILINE)))
    assert codes | {0, 1, 6, 70, 130, 141, 143} <= listed


def test_the_readme_names_the_function_of_every_command_that_is_called_otherwise() -> None:
    import p3i

    said = re.search(
        r"functions of the same name, except (.*?)\)\.", TEXT[ROOT / "README.md"], flags=re.DOTALL
    )
    assert said is not None
    otherwise = dict(re.findall(r"`(\w+)` is `p3i\.(\w+)`", TEXT[ROOT / "README.md"]))
    for name in COMMANDS:
        if name in said[1] and name not in otherwise:
            assert not hasattr(p3i, name)
        else:
            assert callable(getattr(p3i, otherwise.get(name, name)))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_between_documents_leads_to_a_file(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", TEXT[path]):
        assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_document_is_reachable_from_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    linked = {(index.parent / target).resolve() for target in re.findall(r"\]\(([^)#:]+)\)", TEXT[index])}
    missing = [path.name for path in DOCUMENTS if path.parent != ROOT and path.resolve() not in linked]
    assert [name for name in missing if name != "README.md"] == []


def test_the_glossary_is_in_alphabetical_order() -> None:
    terms = re.findall(r"^\*\*(.+?)\*\*", TEXT[ROOT / "docs" / "glossary.md"], flags=re.MULTILINE)
    assert len(terms) > 20
    assert terms == sorted(terms, key=str.lower)


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.p3p")), ids=lambda path: path.name)
def test_every_example_is_canonical_and_has_no_findings(path: Path) -> None:
    import p3i

    text = path.read_text(encoding="utf-8")
    assert list(p3i.check(text)) == []
    assert p3i.format(p3i.loads(text)) == text


def test_the_readme_runs_from_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", TEXT[ROOT / "README.md"], flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "SetCameraPose" in printed
    assert (tmp_path / "rings.svg").exists()
