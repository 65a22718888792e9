"""Rendered scenes with known truth: photo-like pictures of lattices, rings and hybrids.

Everything follows from a seed: the same seed gives the same pixels.
"""

from collections.abc import Callable, Mapping
from typing import Any

from p3i.evaluation.annotations import annotation
from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.evaluation.lattice_scenes import SceneOptions, lattice_scene
from p3i.evaluation.ring_plan import RingOptions
from p3i.evaluation.ring_scenes import ring_scene
from p3i.evaluation.scene import Scene
from p3i.search.result import StructureFound

__all__ = [
    "SCENES",
    "RingOptions",
    "Scene",
    "SceneOptions",
    "annotation",
    "hybrid_scene",
    "lattice_scene",
    "ring_scene",
    "scene",
]

SCENES: Mapping[StructureFound, Callable[..., Scene]] = {
    "lattice": lattice_scene,
    "circular": ring_scene,
    "hybrid": hybrid_scene,
}
"""The maker of scenes of each structure, from a seed and options of its own."""


def scene(structure: StructureFound, seed: int, **changes: Any) -> Scene:
    """The scene of a seed; `changes` are fields of SceneOptions for lattices, else of RingOptions."""
    return SCENES[structure](seed, **changes)
