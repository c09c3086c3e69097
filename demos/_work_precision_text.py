"""The study in words: who wins where and by what factor, made from the points alone."""

from collections.abc import Mapping, Sequence
from statistics import median

from _work_precision_figures import COSTS, NAMES, known
from _work_precision_problems import METHODS, Problem, own_check
from _work_precision_runs import MESHES, REPEATS, THINNER, Choice, Trial, same
from _work_precision_verdicts import TIE, TOLERANCES, Verdict, judge, methods_of

from ufl_origami.work_precision import Cost, Point, order, picked

UNITS = {"seconds": "s", "dofs": "unknowns"}
TITLES = {method.name: method.title for method in METHODS}


def number(value: float) -> str:
    """Three digits, without exponent for thousands of unknowns."""
    return f"{value:.3g}" if value < 1000 else f"{float(f'{value:.3g}'):.0f}"


def price(cost: Cost | None) -> str:
    """A cost in words."""
    if cost is None:
        return "not reached"
    return f"{'at most ' if cost.most else ''}{number(cost.value)}"


def factor_text(verdict: Verdict, name: str) -> str:
    """How much dearer a method is than the winner."""
    if verdict.paid[name] is None:
        return f"{TITLES[name]} does not reach it"
    tie = " (a tie)" if name in verdict.ties else ""
    return f"{TITLES[name]} {number(verdict.factor(name))} times{tie}"


def sentence(verdict: Verdict) -> str:
    """One verdict as a sentence."""
    head = f"{verdict.problem.ratio} = {verdict.thickness:g}, {verdict.mesh} mesh"
    if verdict.winner is None:
        return f"{head}: no method reaches it."
    others = [factor_text(verdict, name) for name in verdict.paid if name != verdict.winner]
    cost = f"{price(verdict.paid[verdict.winner])} {UNITS[verdict.cost]}"
    tail = f"; {', '.join(others)}" if others else ""
    return f"{head}: **{TITLES[verdict.winner]}** wins with {cost}{tail}."


def percent(value: float) -> str:
    """A tolerance in percent."""
    return f"{100 * value:g} %"


def report(
    points: Sequence[Point],
    choices: Mapping[str, Mapping[str, Choice]],
    thin: Mapping[str, Sequence[Trial]],
    ranks: int,
) -> str:
    """The whole text, in Markdown.

    Args:
        points: all points.
        choices: problem -> method -> settings.
        thin: problem -> what is known of smaller thicknesses.
        ranks: number of processes.
    """
    verdicts = list(judge(points))
    parts = [
        ["# Speed against accuracy", "", *introduction(points, ranks)],
        ["## In short", "", *summary(verdicts)],
        ["## Who wins", "", *winners(verdicts)],
        ["## Cost of each tolerance", "", *tables(verdicts)],
        ["## Orders of convergence", "", *orders(points)],
        ["## Where the seconds go", "", *shares(points)],
        ["## Settings", "", *settings(choices)],
        ["## What the references allow", "", *floors(points, thin)],
    ]
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def introduction(points: Sequence[Point], ranks: int) -> list[str]:
    """How to read the figures."""
    elapsed = sum(p.elapsed for p in points) / sum(p.seconds for p in points)
    failed = sum(bool(p.failure) for p in points)
    return [
        f"{len(points)} points, {failed} of them without a solution, on {ranks} rank(s). Made by "
        "`./run demo speed_accuracy`; nothing is written by hand.",
        "",
        "- Seconds are processor seconds of the slowest rank for the whole path from rest to the "
        "full load: assembly, factorisations, solves, stability of each state. Making the mesh and "
        f"building the model are left out. A point is the fastest of up to {REPEATS} runs (one "
        "with --quick), after all kernels were compiled. In this run "
        f"{elapsed:.2f} seconds passed for each of them.",
        "- A tolerance is met from that mesh on from which all finer ones meet it as well; costs "
        "between two meshes are interpolated on the logarithmic chart, and a finer mesh that costs "
        'less counts instead. "At most": the coarsest mesh meets it already. A tie: within '
        f"{TIE:g} times the seconds of the winner, by which repeated studies differ.",
        "- Errors are relative: included fold angle and pull to those of the elastica, profile "
        "(largest distance of a vertex of the front edge from its place) to the panel's width, the "
        "worse of the two measured displacements to its reference.",
    ]


def summary(verdicts: Sequence[Verdict]) -> list[str]:
    """How often each method wins over all problems and thicknesses, by kind of mesh."""
    lines = []
    for tolerance in TOLERANCES:
        for cost in COSTS:
            for mesh in MESHES:
                wanted = (tolerance, cost, mesh, "largest")
                some = [v for v in verdicts if (v.tolerance, v.cost, v.mesh, v.error) == wanted]
                what = "seconds" if cost == "seconds" else "unknowns"
                head = f"- At {percent(tolerance)} in {what} on {mesh} meshes"
                lines.append(f"{head} ({len(some)} cases): {tallies(some)}.")
    return lines


def tallies(verdicts: Sequence[Verdict]) -> str:
    """Wins of all methods."""
    some = [v for v in verdicts if v.winner]
    names = [name for name in TITLES if any(name in v.paid for v in some)]
    none = f"no method reaches it in {len(verdicts) - len(some)}"
    parts = [tally(some, name) for name in names]
    return "; ".join(parts + [none] * (len(some) < len(verdicts)))


def tally(verdicts: Sequence[Verdict], name: str) -> str:
    """Wins and ties of one method, by what factor it loses else, how often it gets nowhere."""
    won = sum(v.ties == (name,) for v in verdicts)
    tied = sum(name in v.ties for v in verdicts) - won
    lost = [v.factor(name) for v in verdicts if name not in v.ties and v.paid.get(name)]
    missed = sum(name in v.paid and v.paid[name] is None for v in verdicts)
    shared = f" and ties {tied}" if tied else ""
    behind = f", else {number(median(lost))} times the winner in the median" if lost else ""
    never = f", not reached in {missed}" if missed else ""
    return f"{TITLES[name]} wins {won}{shared}{behind}{never}"


def winners(verdicts: Sequence[Verdict]) -> list[str]:
    """One list a problem, tolerance and cost, for the largest error."""
    lines: list[str] = []
    largest = [v for v in verdicts if v.error == "largest"]
    for problem in dict.fromkeys(v.problem.name for v in largest):
        own = [v for v in largest if v.problem.name == problem]
        for tolerance in TOLERANCES:
            for cost in COSTS:
                unit = "seconds" if cost == "seconds" else "unknowns"
                title = f"{own[0].problem.title}, {percent(tolerance)}, in {unit}"
                lines += [f"{title} (largest error):", ""]
                some = [v for v in own if (v.tolerance, v.cost) == (tolerance, cost)]
                lines += [f"- {sentence(verdict)}" for verdict in some] + [""]
    return lines[:-1]


def tables(verdicts: Sequence[Verdict]) -> list[str]:
    """One table a tolerance and cost with all errors; the winner is bold."""
    lines: list[str] = []
    for tolerance in TOLERANCES:
        for cost in COSTS:
            some = [v for v in verdicts if (v.tolerance, v.cost) == (tolerance, cost)]
            methods = [name for name in TITLES if any(name in v.paid for v in some)]
            unit = "Seconds" if cost == "seconds" else "Unknowns"
            titles = [TITLES[name] for name in methods]
            lines += [f"{unit} at {percent(tolerance)}:", ""]
            lines += head(["problem", "thickness", "error", "mesh", *titles])
            lines += [verdict_row(v, methods) for v in some] + [""]
    return lines[:-1]


def verdict_row(verdict: Verdict, methods: Sequence[str]) -> str:
    """One line of a table of costs."""
    cells = []
    for name in methods:
        text = price(verdict.paid.get(name))
        cells.append(f"**{text}**" if name == verdict.winner else text)
    thickness = f"{verdict.problem.ratio} = {verdict.thickness:g}"
    return row([verdict.problem.title, thickness, NAMES[verdict.error], verdict.mesh, *cells])


def head(titles: Sequence[str]) -> list[str]:
    """Head of a table."""
    return [row(titles), "|" + "---|" * len(titles)]


def row(cells: Sequence[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def orders(points: Sequence[Point]) -> list[str]:
    """Order of each curve in the size of the mesh."""
    lines = [
        "Of the largest error, fitted through the three finest meshes; where these have reached "
        'the floor of the reference (see "What the references allow") it says nothing.',
        "",
    ]
    methods = methods_of(points)
    lines += head(["problem", "thickness", "mesh", *(TITLES[name] for name in methods)])
    for problem in known(points):
        own = picked(points, problem=problem.name)
        for thickness in dict.fromkeys(p.thickness for p in own):
            for mesh in MESHES:
                some = picked(own, thickness=thickness, mesh=mesh)
                found = [f"{order(picked(some, method=name)):.2f}" for name in methods]
                lines.append(row([problem.title, f"{thickness:g}", mesh, *found]))
    return lines


def shares(points: Sequence[Point]) -> list[str]:
    """Parts of the path's seconds on the coarsest and the finest mesh."""
    lines = ["On unstructured meshes, coarsest and finest, in percent of the path.", ""]
    lines += head(["problem", "method", "unknowns", "seconds", "assembly", "factorisation", "rest"])
    for problem in known(points):
        own = picked(points, problem=problem.name, mesh="unstructured")
        own = [p for p in own if p.thickness == own[0].thickness]
        for method in methods_of(own):
            some = picked(own, method=method, failure="")
            for p in dict.fromkeys((some[0], some[-1])) if some else ():
                parts = (p.assembly_seconds, p.factorisation_seconds, p.rest_seconds)
                cells = [f"{100 * part / p.seconds:.0f}" for part in parts]
                lines.append(
                    row([problem.title, TITLES[method], str(p.dofs), f"{p.seconds:.3g}", *cells])
                )
    return lines


def settings(choices: Mapping[str, Mapping[str, Choice]]) -> list[str]:
    """What each method was run with, and the scan that chose it."""
    sizes = load_steps(choices)
    steps = ", ".join(f"{size:g}" for size in sizes)
    lines = [
        f"Chosen for each problem and method on its middle meshes, of both kinds, at the middle "
        f"thickness. Load step: out of {steps} of the load the one with the fewest factorisations "
        "on all of them together (listed in this order) that finds the equilibrium of the smallest "
        'one on each; "-": a path fails or ends elsewhere. Tilt measure of averaged normals: the '
        "one with the smaller error (geometric mean over the meshes; the paper's is sin). All "
        "else is the default.",
        "",
        *head(["problem", "method", "load step", "factorisations", "measure", "error"]),
    ]
    for problem, chosen in choices.items():
        for name, choice in chosen.items():
            counts = ", ".join(effort(choice, size) for size in sizes)
            tried = [f"{t.measure} {100 * t.largest:.2g} % ({t.mesh})" for t in choice.measures]
            measure = choice.measure or "-"
            cells = [f"{choice.step:g}", counts, measure, ", ".join(tried) or "-"]
            lines.append(row([problem.replace("_", " "), TITLES[name], *cells]))
    return lines


def load_steps(choices: Mapping[str, Mapping[str, Choice]]) -> list[float]:
    """Load steps of the scan."""
    every = [choice for chosen in choices.values() for choice in chosen.values()]
    return sorted({trial.step for choice in every for trial in choice.steps})


def effort(choice: Choice, step: float) -> str:
    """Factorisations of one load step in the scan, "-" where it is of no use."""
    smallest = min(t.step for t in choice.steps)
    reference = {(t.mesh, t.n): t.errors for t in choice.steps if t.step == smallest}
    some = [t for t in choice.steps if t.step == step]
    if not all(same(t.errors, reference[t.mesh, t.n]) for t in some):
        return "-"
    return str(sum(t.factorisations for t in some))


def floors(points: Sequence[Point], thin: Mapping[str, Sequence[Trial]]) -> list[str]:
    """How far the references can be trusted, and what was left out."""
    lines = []
    for problem in known(points):
        own = [p for p in picked(points, problem=problem.name) if not p.failure]
        if problem.table:
            lines.append(f"- {problem.title}: {table_floor(problem, own)}{reach(problem, thin)}")
        else:
            floor = f"which is the floor at {max(problem.thicknesses):g}"
            stretch = f"a sheet does by about the square of {problem.ratio}, {floor}"
            lines.append(f"- {problem.title}: {problem.reference} does not stretch; {stretch}.")
    return lines


def table_floor(problem: Problem, points: Sequence[Point]) -> str:
    """What is known of the error of a table."""
    curves = [
        picked(points, method=name, mesh=mesh) for name in methods_of(points) for mesh in MESHES
    ]
    ends = [curve[-1] for curve in curves if curve]
    off = [f"{TITLES[p.method]} {p.mesh} {100 * (p.error_deflection or 0):+.2f} %" for p in ends]
    return (
        f"{problem.reference}, which its own coarser computation misses by "
        f"{100 * own_check(problem):.2g} %. Finest meshes: {', '.join(off)}; where they agree "
        "with each other better than with the table, the distance is the table's."
    )


def reach(problem: Problem, thin: Mapping[str, Sequence[Trial]]) -> str:
    """Why a table serves one thickness only."""
    tried = thin.get(problem.name, ())
    if not tried:
        return ""
    off = " and ".join(
        f"{100 * t.largest:.1f} % (n = {t.n})" if t.errors else f"no solution (n = {t.n})"
        for t in tried
    )
    return (
        f" Its thickness is the only one that is judged: with h / {THINNER:g} and the same bending "
        f"stiffness the last method on its two finest structured meshes is {off} away from the "
        "table, by membrane strains that are not small beside bending."
    )
