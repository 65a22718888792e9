"""Strict mode (thin for now)."""

from p3i.grammar.ast import Program
from p3i.grammar.diagnostics import Diagnostic


def strict_problems(source: str | bytes, program: Program) -> tuple[Diagnostic, ...]:
    """Placeholder."""
    return ()


def departures(program: Program) -> tuple[Diagnostic, ...]:
    """Placeholder."""
    return ()
