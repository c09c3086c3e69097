"""Compliant origami on FEniCSx: thin elastic sheets with creases.

The names below are loaded when they are first used, so that importing the package costs nothing.
"""

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "AccuracyWarning": "errors",
    "Anisotropic": "friction_laws",
    "Barrier": "barrier",
    "Box": "obstacles",
    "ContactWarning": "errors",
    "Coulomb": "friction_laws",
    "Cylinder": "obstacles",
    "Direction": "friction_laws",
    "DynamicResult": "dynamics",
    "OneWay": "friction_laws",
    "Plane": "obstacles",
    "SignedDistance": "obstacles",
    "Sphere": "obstacles",
    "TimeSettings": "solvers.dynamics",
    "solve_dynamic": "dynamics",
    "spin": "scene_surroundings",
    "suggest_barrier": "suggestions",
    "CreasePattern": "pattern",
    "Material": "material",
    "MeshError": "errors",
    "InputError": "errors",
    "Model": "model",
    "NewtonSettings": "solvers.newton",
    "PatternError": "errors",
    "Record": "history",
    "Scene": "scene",
    "SceneError": "errors",
    "SheetMesh": "sheet",
    "SolveError": "errors",
    "StaticResult": "run",
    "StepSettings": "solvers.static",
    "NewtonSolver": "solvers.newton",
    "StaticPath": "solvers.static",
    "MeshWarning": "errors",
    "BranchWarning": "errors",
    "StabilityWarning": "errors",
    "RoundOffWarning": "errors",
    "SupportWarning": "errors",
    "ArcSettings": "solvers.arc",
    "PathResult": "paths",
    "PathStop": "path_stops",
    "at_fold_angle": "path_stops",
    "at_gap": "path_stops",
    "at_load": "path_stops",
    "at_position": "path_stops",
    "follow_branch": "branches",
    "follow_path": "paths",
    "jump": "jumps",
    "landscape": "landscapes",
    "modes": "branches",
    "restore": "branches",
    "stability": "branches",
    "switch_branch": "branches",
    "verdict": "branches",
    "build": "discretise",
    "mesh_pattern": "meshing",
    "read_fold": "fold_io",
    "read_history": "history",
    "recommend": "recommendation",
    "sheet_from_arrays": "sheet",
    "solve_static": "run",
    "write_fold": "fold_io",
}
_SUBPACKAGES = ("analytic", "errors", "gallery", "plotting")

__all__ = ["__version__", *_HOMES, *_SUBPACKAGES]


def __getattr__(name: str) -> object:
    """Load a public name from its module (PEP 562)."""
    if name in _SUBPACKAGES:
        return import_module(f"{__name__}.{name}")
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return sorted({*globals(), *__all__})
