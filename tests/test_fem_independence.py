"""The fem model is a second opinion: none of its modules imports the ddg model's mechanics."""

import ast
from importlib.util import find_spec
from pathlib import Path

import pytest

PACKAGE = Path(find_spec("ufl_origami").origin).parent
FEM = sorted((PACKAGE / "fem").rglob("*.py"))
FORBIDDEN = (
    "ufl_origami.kernels",
    "ufl_origami.terms.shell",
    "ufl_origami.terms.membrane",
    "ufl_origami.stencils",
    "ufl_origami.springs",
    "ufl_origami.creases",
    "ufl_origami.terms.crease",
)
pytestmark = pytest.mark.serial


def imported(file):
    """Dotted names that a module imports anywhere, functions included."""
    package = ".".join(file.relative_to(PACKAGE.parent).parts[:-1])
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) + 1 - node.level]
            start = ".".join([*base, *filter(None, [node.module])]) if node.level else node.module
            yield from (f"{start}.{alias.name}" for alias in node.names)


def offending(names):
    return sorted(
        name for name in names for bad in FORBIDDEN if name == bad or name.startswith(f"{bad}.")
    )


def test_there_are_modules_to_look_at():
    assert len(FEM) > 3


@pytest.mark.parametrize("file", FEM, ids=lambda file: file.name)
def test_no_module_of_the_fem_model_imports_ddg_mechanics(file):
    assert not offending(imported(file))


def test_the_search_sees_all_kinds_of_imports(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "ufl_origami")
    folder = tmp_path / "ufl_origami" / "fem"
    folder.mkdir(parents=True)
    file = folder / "bad.py"
    file.write_text(
        "import ufl_origami.kernels.hinge\n"
        "from ufl_origami import kernels, sheet\n"
        "from ufl_origami.terms.crease import CreaseTerm\n"
        "def late():\n"
        "    from ..terms import shell\n"
    )
    assert offending(imported(file)) == [
        "ufl_origami.kernels",
        "ufl_origami.kernels.hinge",
        "ufl_origami.terms.crease.CreaseTerm",
        "ufl_origami.terms.shell",
    ]
