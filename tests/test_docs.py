"""The documents against the repository: code runs, links lead somewhere, names and values exist."""

import dataclasses
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ufl_origami as uo
from ufl_origami import demo
from ufl_origami.scene import Scene
from ufl_origami.scene_surroundings import Surroundings
from ufl_origami.solvers.arc import ArcSettings
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.solvers.newton import NewtonSettings
from ufl_origami.solvers.static import StepSettings

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/*.md"))]
README = DOCUMENTS[0].read_text()
EXAMPLES = {
    "my_scene.py",
    "my_motion.py",
    "foundation.py",
    "test_foundation.py",
    "ufl_origami/terms/foundation.py",
}
EXAMPLES |= {"tests/test_foundation.py", "demos/NAME.py"}
each_document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)


def blocks(document):
    """Python code blocks of a document."""
    return re.findall(r"^```python\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL)


def run(*arguments, folder, path=()):
    """Run Python in a process of its own, in a folder, with the repository on its path."""
    search = os.pathsep.join(map(str, [ROOT, *path]))
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": search},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_first_scene_runs_and_agrees_with_the_elastica(tmp_path, monkeypatch, capsys):
    code, _ = blocks(DOCUMENTS[0])
    assert len(code.splitlines()) <= 20
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    history, exact = names["result"].history, names["exact"]
    assert history["load_factor"][-1] == 1.0
    assert history["included_virtual_crease"][-1] == pytest.approx(
        exact.included_angle_deg, abs=0.1
    )
    assert history["reaction_right_edge_x"][-1] == pytest.approx(exact.force, rel=0.01)
    assert (tmp_path / "output/first_scene/history.csv").exists()
    assert f"{exact.included_angle_deg:.3f}" in README
    assert "elastica at 1:" in capsys.readouterr().out


def test_first_motion_runs_and_its_energy_book_is_balanced(tmp_path, monkeypatch, capsys):
    _, code = blocks(DOCUMENTS[0])
    assert len(code.splitlines()) <= 20
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    history, contact = names["result"].history, names["result"].model.contacts[0]
    assert history["time"][-1] == 0.2
    losses = {way: history[f"lost_{way}"] for way in ("damping", "friction", "integrator")}
    for way in ("damping", "friction"):
        assert np.diff(losses[way]).min() > -1e-3 * losses[way][-1]
    assert min(loss[-1] for loss in losses.values()) > 1e-3
    scale = np.abs(history["energy_gravity"]).max()
    assert np.abs(history["imbalance"]).max() < 1e-8 * scale
    assert 0 < contact.smallest < contact.at.surface.barrier.distance
    assert "smallest gap:" in capsys.readouterr().out


def test_first_path_passes_both_limit_points():
    (code,) = blocks(ROOT / "docs" / "paths.md")
    names = {}
    exec(compile(code, "paths.md", "exec"), names)
    path = names["path"]
    limit = 1e4 * 0.3 * 0.2**3 / (1 + 0.2**2) ** 1.5 * 2 / 3**1.5  # truss in Green's strain
    loads = [9.0 * event.load for event in path.events]
    assert loads == pytest.approx([limit, -limit], rel=1e-4)
    assert [(event.before, event.after) for event in path.events] == [(0, 1), (1, 0)]
    assert path.reason == "load factor = 1.5"


def test_example_of_an_own_term_runs_as_it_stands(tmp_path):
    term, test, _ = blocks(ROOT / "CONTRIBUTING.md")
    (tmp_path / "foundation.py").write_text(term)
    (tmp_path / "test_foundation.py").write_text(test)
    options = ["-q", "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path, "-p", "no:cacheprovider"]
    done = run(
        *["-m", "pytest", *options, "-p", "conftest", "test_foundation.py"],
        folder=tmp_path,
        path=[ROOT / "tests", tmp_path],
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "3 passed" in done.stdout


def test_warnings_reach_a_script_that_set_up_no_logging(tmp_path):
    script = (
        "import ufl_origami as uo\n"
        "from ufl_origami.discretise import build\n"
        "sheet = uo.mesh_pattern(uo.gallery.z_fold(), 0.5, structure='crisscross')\n"
        "scene = uo.Scene(sheet, uo.Material(1e7, 0.0, 0.01), bending='averaged')\n"
        "scene.crease('crease', 1.0)\n"
        "build(scene)\n"
    )
    done = run("-c", script, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "MeshWarning: averaged normals fail the patch check" in done.stderr


@each_document
def test_links_lead_to_files(document):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", document.read_text())
    missing = [link for link in links if not (document.parent / link).exists()]
    assert not missing


@each_document
def test_named_files_exist(document):
    named = set(re.findall(r"`([\w./]+\.(?:py|md|txt|toml|fold))`", document.read_text()))
    places = [ROOT, ROOT / "ufl_origami", document.parent]
    missing = {n for n in named - EXAMPLES if not any((place / n).exists() for place in places)}
    assert not missing


@each_document
def test_documents_are_plain_ascii(document):
    assert document.read_text().isascii()


def test_public_names_of_the_readme_exist():
    names = set(re.findall(r"\buo((?:\.\w+)+)", README))
    assert len(names) > 5
    for name in names:
        thing = uo
        for part in name.split(".")[1:]:
            thing = getattr(thing, part)
    for name in re.findall(r"`(ufl_origami(?:\.\w+)+)", README):
        module, attribute = name.rsplit(".", 1)
        assert hasattr(importlib.import_module(module), attribute), name


def test_methods_of_the_scene_in_the_readme_exist():
    (sentence,) = re.findall(r"`Scene` has also (.*?);", README, re.DOTALL)
    (around,) = re.findall(r"- Around the sheet: (.*?)\.", README, re.DOTALL)
    methods = set(re.findall(r"`(\w+)`", sentence + around))
    used = set(re.findall(r"scene\.(\w+)\(", README))
    public = {n for n in vars(Scene) | vars(Surroundings) if not n.startswith("_")}
    public -= {field.name for field in dataclasses.fields(Scene)} | {"panel_material"}
    assert methods | used == public


SETTINGS = {
    "solver.md": (NewtonSettings(), StepSettings()),
    "time.md": (TimeSettings(step=1.0),),
    "paths.md": (ArcSettings(),),
}


@pytest.mark.parametrize(
    ("document", "settings"),
    [(document, one) for document, some in SETTINGS.items() for one in some],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_settings_in_the_document_are_those_of_the_code(document, settings):
    text = (ROOT / "docs" / document).read_text()
    table = text.split(f"| `{type(settings).__name__}` |")[1].split("\n\n")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", table, re.MULTILINE)
    documented = {name: value.strip("`\"' ") for name, value in rows}
    default = vars(settings)
    assert set(documented) == set(default)
    for name, value in default.items():
        if value is None or name == "step":
            assert not documented[name][0].isdigit(), name  # told in words
        elif isinstance(value, float | int) and not isinstance(value, bool):
            assert float(documented[name]) == pytest.approx(value, rel=1e-12), name
        else:
            assert documented[name] == str(value), name


def test_variables_of_the_launcher_are_documented():
    scripts = [ROOT / "run", *(ROOT / "launcher").glob("*.*")]
    used = {v for s in scripts for v in re.findall(r"UFL_ORIGAMI_\w+", s.read_text())}
    inner = {"UFL_ORIGAMI_INSIDE"}
    assert set(re.findall(r"`(UFL_ORIGAMI_\w+)`", README)) == used - inner


def test_options_of_the_demos_are_documented():
    (sentence,) = re.findall(r"^Options: (.*?)\. ", README, re.MULTILINE | re.DOTALL)
    documented = set(re.findall(r"--(\w+)", sentence))
    assert documented | {"model"} == set(demo.OPTIONS) | {"output", "quick"}


@pytest.mark.parametrize("folder", ["demos", "benchmarks"])
def test_every_script_has_its_row_in_the_readme(folder):
    scripts = {f"{folder}/{path.name}" for path in (ROOT / folder).glob("[!_]*.py")}
    assert scripts == set(re.findall(rf"\(({folder}/\w+\.py)\)", README))


def test_pictures_are_small():
    pictures = re.findall(r"!\[.*\]\((.*)\)", README)
    assert pictures
    assert all((ROOT / picture).stat().st_size < 300_000 for picture in pictures)
