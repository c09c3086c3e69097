"""The static solver: methods agree, failures raise, every accepted state knows its inertia."""

import warnings

from petsc4py import PETSc

import numpy as np
import pytest
from scenes import E, H, build, disturb, follow, z_fold_scene

from ufl_origami.errors import BranchWarning, SolveError, StabilityWarning
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings

LENGTH, THICKNESS, YOUNG = 10.0, 0.1, 1.2e6
EULER_STRAIN = np.pi**2 * THICKNESS**2 / (12 * LENGTH**2)


@pytest.mark.mpi
@pytest.mark.parametrize("method", ["newton", "bt", "l2"])
def test_other_methods_reach_the_same_equilibrium(method):
    angles = {}
    for name in ("default", method):
        model = build(z_fold_scene(0.25, 0.3, d1=0.2))
        follow(model, first=0.125, newton=NewtonSettings(method=name))
        angles[name] = model.mean_fold_angle("crease")
    assert angles[method] == pytest.approx(angles["default"], abs=1e-7)


def newton_step(model, solver, x):
    """One full Newton step with the exact tangent, in place."""
    problem, residual, step = model.problem, x.duplicate(), x.duplicate()
    problem.residual(x, residual)
    problem.linearise(None, x)
    matrix = problem.stiffness(x)
    problem.constrain(matrix, None, None)
    solver.factor(solver.linear.ksp)
    solver.linear.solve(residual, step)
    x.axpy(-1.0, step)


@pytest.mark.mpi
@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_newton_squares_the_error(bending):
    model = build(z_fold_scene(0.25, 0.3, bending=bending, structure="structured"))
    follow(model, newton=NewtonSettings(rtol=1e-13))
    solver = NewtonSolver(model.problem, NewtonSettings(method="newton"))
    for _ in range(2):
        newton_step(model, solver, model.x)
    solution, disturbed = model.x.copy(), model.x.copy()
    newton_direction = random_free_direction(model, disturbed)
    sizes, errors = 1e-4 * 0.5 ** np.arange(5), []
    for size in sizes:
        x = solution.copy()
        x.axpy(size, newton_direction)
        newton_step(model, solver, x)
        x.axpy(-1.0, solution)
        errors.append(x.norm())
    order = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.1), errors


def random_free_direction(model, x):
    """Smooth direction of norm one that leaves the prescribed unknowns alone."""
    disturb(model, 0.1)
    direction = model.x.copy()
    direction.axpy(-1.0, x)
    direction.array_w[model.problem.constraints.dofs] = 0.0
    direction.scale(1.0 / direction.norm())
    return direction


@pytest.mark.mpi
def test_a_refused_state_is_cut_down_to_the_smallest_step_and_raises():
    model = build(z_fold_scene(0.25, 0.1))
    solver = NewtonSolver(model.problem)
    settings = StepSettings(first=0.125, smallest=1e-3)
    accepted = []

    def refuse(trial):
        return "further than allowed" if model.problem.time > 0.3 else ""

    path = StaticPath(model.problem, solver, settings, refuse)
    with pytest.raises(SolveError, match=r"smallest size 0\.001: further than allowed") as caught:
        path.run(model.x, 0.0, [1.0], lambda step, x: accepted.append((step, x.copy())))
    last, x = accepted[-1]
    assert caught.value.load_factor == last.time
    assert 0.3 - 2e-3 < last.time <= 0.3
    assert any(step.cuts for step, _ in accepted)
    x.axpy(-1.0, model.x)
    assert x.norm() == 0.0


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.BranchWarning")
@pytest.mark.mpi
def test_the_watchdog_carries_starved_full_steps_to_the_same_equilibrium():
    angles = []
    for iterations in (12, 1):
        model = build(z_fold_scene(0.25, 0.1))
        newton = NewtonSettings(iterations=iterations)
        path = follow(model, first=0.5, newton=newton, retreats=0)
        assert all(step.cuts == 0 for step in path.steps)
        angles.append(model.mean_fold_angle("crease"))
    assert sum(step.iterations for step in path.steps) > 2 * len(path.steps)
    assert angles[1] == pytest.approx(angles[0], abs=1e-9)


def hinge_led_round(model):
    """Two flat unit panels joined by a free hinge, the outer edge led along a circle about it."""
    sheet = mesh_pattern(z_fold(included_angle=180.0), 1 / 8, structure="structured")
    scene = Scene(sheet, Material(E, 0.0, H), model=model)
    scene.crease("crease", 0.0)
    scene.fix("left_edge")
    scene.clamp("left_edge")
    scene.move(
        "right_edge",
        x=lambda time: np.cos(0.5 * np.pi * time) - 1.0,
        y=0.0,
        z=lambda time: np.sin(0.5 * np.pi * time),
    )
    return build(scene)


def test_a_step_that_would_end_on_another_branch_is_cut():
    """Exact: both panels stay flat. The watchdog finds another equilibrium from too far away."""
    model = hinge_led_round("ddg")
    with warnings.catch_warnings():
        warnings.simplefilter("error", BranchWarning)
        follow(model)
    assert model.mean_fold_angle("crease") == pytest.approx(0.5 * np.pi, abs=1e-6)
    model = hinge_led_round("ddg")
    with pytest.warns(BranchWarning, match="far from the predicted one"):
        follow(model, retreats=0)
    assert abs(model.mean_fold_angle("crease") - 0.5 * np.pi) > 1.0


@pytest.mark.mpi
def test_an_unreachable_tolerance_is_no_convergence():
    model = build(z_fold_scene(0.25, 0.1))
    settings = NewtonSettings(rtol=0.0, floor=0.0, iterations=5, cycles=2)
    with pytest.raises(SolveError, match="DIVERGED_MAX_IT"):
        follow(model, newton=settings)


def compressed_strip(strain):
    """Strip between hinged ends, shortened by a strain; nothing pushes it out of its plane."""
    sheet = rectangle(LENGTH, 1.0, n=(20, 2), structure="structured")
    scene = Scene(sheet, Material(YOUNG, 0.0, THICKNESS))
    scene.fix("x0")
    scene.move("x1", x=-strain * LENGTH, y=0.0, z=0.0)
    return scene


@pytest.mark.mpi
@pytest.mark.parametrize(("loads", "modes"), [(0.9, 0), (1.1, 1), (4.5, 2)])
def test_straight_column_counts_the_modes_beyond_their_euler_loads(loads, modes):
    model = build(compressed_strip(loads * EULER_STRAIN))
    if modes:
        with pytest.warns(StabilityWarning, match=f"{modes} negative pivots"):
            path = follow(model, first=1.0)
    else:
        path = follow(model, first=1.0)
    assert path.steps[-1].negative_pivots == modes
    assert path.steps[-1].stability == ("unstable" if modes else "stable")


@pytest.mark.serial
def test_inertia_equals_the_signs_of_the_eigenvalues():
    model = build(compressed_strip(4.5 * EULER_STRAIN))
    with pytest.warns(StabilityWarning):
        path = follow(model, first=1.0)
    problem = model.problem
    problem.linearise(None, model.x)
    matrix = problem.stiffness(model.x)
    problem.constrain(matrix, None, None)
    eigenvalues = np.linalg.eigvalsh(matrix.convert("dense").getDenseArray())
    assert (eigenvalues < 0).sum() == path.steps[-1].negative_pivots == 2


def test_options_under_the_prefix_reach_the_solver_and_leave_no_trace():
    model = build(z_fold_scene(0.4, 0.3, d1=0.2))
    solver = NewtonSolver(model.problem, NewtonSettings(prefix="mine_", options={"pc_type": "lu"}))
    path = StaticPath(model.problem, solver, StepSettings())
    path.run(model.x, 0.0, [1.0])
    assert solver.linear.ksp.pc.getType() == "lu"
    assert {step.stability for step in path.steps} == {"unknown"}
    assert not [key for key in PETSc.Options().getAll() if key.startswith("mine_")]


def test_options_that_the_factorisation_reads_late_reach_it_too():
    model = build(z_fold_scene(0.4, 0.3, d1=0.2))
    settings = NewtonSettings(prefix="late_", options={"mat_mumps_icntl_14": 55})
    solver = NewtonSolver(model.problem, settings)
    StaticPath(model.problem, solver, StepSettings()).run(model.x, 0.0, [1.0])
    assert solver.linear.ksp.pc.getFactorMatrix().getMumpsIcntl(14) == 55
    assert not [key for key in PETSc.Options().getAll() if key.startswith("late_")]


def test_options_of_the_user_win_over_the_defaults():
    PETSc.Options().setValue("ufl_origami_pc_type", "lu")
    try:
        solver = NewtonSolver(build(z_fold_scene(0.4, 0.3, d1=0.2)).problem)
        assert solver.linear.ksp.pc.getType() == "lu"
        assert PETSc.Options().getString("ufl_origami_pc_type") == "lu"
    finally:
        PETSc.Options().delValue("ufl_origami_pc_type")


@pytest.mark.mpi
def test_steps_stop_exactly_where_asked_and_grow_when_easy():
    model = build(z_fold_scene(0.25, 1.0))
    path = follow(model, (0.5, 0.8, 1.0), first=0.05)
    times = [step.time for step in path.steps]
    assert {0.5, 0.8, 1.0} <= set(times)
    assert times == sorted(times)
    sizes = [step.size for step in path.steps]
    assert sizes[1] == pytest.approx(1.5 * sizes[0])


@pytest.mark.mpi
def test_an_unstable_branch_is_followed_and_reported():
    model = build(compressed_strip(3.0 * EULER_STRAIN))
    with pytest.warns(StabilityWarning):
        path = follow(model, (0.2, 0.6, 1.0), first=0.2)
    assert [bool(step.negative_pivots) for step in path.steps][-1]
    assert path.steps[0].stability == "stable"
    assert np.abs(model.state.q[2 : 3 * len(model.state.x) : 3]).max(initial=0.0) < 1e-9


@pytest.mark.mpi
def test_a_roll_up_in_one_step_is_cut_where_its_turn_would_be_a_guess():
    scene = Scene(
        rectangle(LENGTH, 1.0, n=(60, 4), structure="structured"), Material(YOUNG, 0.0, THICKNESS)
    )
    scene.fix("x0")
    scene.clamp("x0")
    scene.fix("sheet", "y")
    scene.edge_moment("x1", 2 * np.pi * 100.0 / LENGTH)
    model = build(scene)
    path = follow(model, first=1.0)
    assert path.steps[0].cuts
    assert model.energies()["bending"] == pytest.approx(0.5 * 100 * (2 * np.pi) ** 2 / 10, rel=0.01)
