"""Cross-validation: registered scenes with both models, and how far their answers are apart.

The ddg model and the finite element twin share no line of shell or crease code. Each scene is
followed with both on meshes on which they are about equally accurate; fold angles, forces, energies
and profiles must agree within the tolerances that the scene states. One scene out of tolerance, or
one that a model cannot follow to its end, and the command fails.

    ./run demo cross_validate
    ./run demo cross_validate -n 2 --scene cantilever_shear
    ./run demo cross_validate --quick --tighten 1000
"""

import csv
from itertools import groupby

from mpi4py import MPI

from ufl_origami.cross_quantities import Profile
from ufl_origami.cross_scenes import load_all
from ufl_origami.cross_validation import cross_validate, registered, registered_scene
from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.plotting import Series, profile_chart
from ufl_origami.scene import MODELS

# %% Which scenes
comm = MPI.COMM_WORLD
fail_together(comm)
load_all()
options = read_options(
    "cross_validate",
    "\n    ".join([f"{__doc__}\nscenes:", *(scene.name for scene in registered())]),
    {"scene": ("all",), "tighten": 1.0},
    quick={"scene": tuple(scene.name for scene in registered() if scene.quick)},
    comm=comm,
)
every = options.scene == ("all",)
scenes = registered() if every else tuple(map(registered_scene, dict.fromkeys(options.scene)))

# %% Both models of each scene
results = []
for scene in scenes:
    results.append(cross_validate(scene, comm, tighten=options.tighten))
    if comm.rank == 0:
        print(f"{scene.name}: {'ok' if results[-1].ok else 'NOT ok'}", flush=True)


# %% Tables
def comparison_rows():
    """Rows of the first table and of comparison.csv."""
    for row in (row for result in results for row in result.rows):
        yield {
            "scene": row.scene,
            "load factor": row.load,
            "quantity": row.quantity,
            **{model: row.values.get(model) for model in MODELS},
            "difference": row.difference,
            "tolerance": row.tolerance,
            "ok": "yes" if row.ok else "NO",
        }


def effort_rows():
    """Rows of the second table, one a scene and model."""
    for result in results:
        for model, run in result.runs.items():
            row = {"scene": result.scene.name, "model": model, "size": result.scene.sizes[model]}
            yield row | (vars(run.effort) if run.effort else {})


COMPARISON = {
    "scene": "s", "load factor": "g", "quantity": "s", **dict.fromkeys(MODELS, ".6g"),
    "difference": ".2e", "tolerance": ".1e", "ok": "s",
}  # fmt: skip
EFFORT = {
    "scene": "s", "model": "s", "size": "g", "triangles": "d", "dofs": "d", "steps": "d",
    "iterations": "d", "seconds": ".2f",
}  # fmt: skip


def write_csv(rows):
    """The first table with all digits."""
    with (options.output / "comparison.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(COMPARISON))
        writer.writeheader()
        writer.writerows(rows)


# %% Figure: the last profile of ddg as a line, that of fem as marks
def profile_series(result):
    """Profiles of a scene's first line at all load factors, both models."""
    found = [i for i, q in enumerate(result.scene.quantities) if isinstance(q, Profile)]
    for model, run in result.runs.items():
        kind, colour = {"ddg": ("line", 0), "fem": ("points", 1)}[model]
        for samples in run.samples if found else ():
            quantity, line = result.scene.quantities[found[0]], samples[found[0]]
            x, z = (line.points[:, "xyz".index(axis)] / quantity.width for axis in quantity.plane)
            yield Series(x, z, model, kind, colour=colour)


def report():
    """Tables, files and figure; on rank 0."""
    rows = list(comparison_rows())
    print()
    for name, group in groupby(rows, lambda row: row["scene"]):
        print_table([row | {"scene": name} for row in group], COMPARISON)
        print()
    print_table(list(effort_rows()), EFFORT)
    write_summary(options.output, [result.summary() for result in results])
    write_csv(rows)
    charts = {result.scene.name: list(profile_series(result)) for result in results}
    if drawn := {name: series for name, series in charts.items() if series}:
        profile_chart(drawn, options.output / "profiles.png", columns=3)
    print(f"\nsummary.json, comparison.csv and the figure are in {options.output}")


if comm.rank == 0:
    report()

# %% The claim
failed = [row for result in results for row in result.rows if not row.ok]
if failed:
    if comm.rank == 0:
        for result in results:
            for model, run in result.runs.items():
                if run.failure:
                    print(f"{result.scene.name}: {model} stopped: {run.failure}")
        print(f"{len(failed)} comparisons out of tolerance")
    raise SystemExit(1)
if comm.rank == 0:
    print(f"both models agree in {len(scenes)} scenes")
