"""An answer as one JSON object: the lines of `p3i synth --format jsonl`."""

from typing import Any

from p3i.grammar.printer import format_program
from p3i.search.result import Candidate, SynthesisResult


def answer_record(result: SynthesisResult, *, image: str, seconds: float) -> dict[str, Any]:
    """The object for a photo with a program, its keys in the documented order.

    `centers` are pixels, to a hundredth; `program` is the canonical text in the layout "python", whatever
    was printed elsewhere. With more than one candidate asked for, `candidates` lists them, the best first.
    Raises ValueError for a result without a program, or a program without a canvas.
    """
    program = result.program
    if program is None or program.header is None or program.header.canvas is None:
        raise ValueError("only a program with a canvas can be recorded")
    width, height = program.header.canvas
    record: dict[str, Any] = {
        "image": image,
        "width": width,
        "height": height,
        "program": format_program(program),
        "structure": result.structure,
        "camera": {
            "rx": program.camera.rx_deg,
            "ry": program.camera.ry_deg,
            "focal": result.focal_mm,
            "focal_from": result.focal_source,
            "focal_reason": result.focal_reason,
        },
        "centers": [[round(x, 2), round(y, 2), i, j] for x, y, i, j in result.centers],
        "region": [[round(x, 1), round(y, 1)] for x, y in result.region],
        "score": _rounded(result.score),
        "margin": _rounded(result.margin),
        "false_alarms": result.false_alarms,
        "seconds": round(seconds, 3),
        "features": result.features,
        "seed": result.seed,
    }
    if result.lens_k1 is not None:
        record["camera"]["lens_k1"] = result.lens_k1
    if result.mirrored is not None:
        record["camera"]["mirrored"] = list(result.mirrored)
    if len(result.candidates) > 1:
        record["candidates"] = [_candidate_record(candidate) for candidate in result.candidates]
    return record


def failure_record(*, image: str, error: str, code: int, seconds: float) -> dict[str, Any]:
    """The object for a photo without a program: the sentence that says why, and its exit code."""
    return {"image": image, "program": None, "error": error, "code": code, "seconds": round(seconds, 3)}


def _candidate_record(candidate: Candidate) -> dict[str, Any]:
    return {
        "program": format_program(candidate.program),
        "structure": candidate.structure,
        "focal": candidate.focal_mm,
        "score": _rounded(candidate.score),
        "false_alarms": candidate.false_alarms,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
