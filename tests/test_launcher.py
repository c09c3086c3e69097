"""The launcher: what a command sees, exit codes, and builds that are whole or absent."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

REPO = Path(__file__).resolve().parent.parent
RUN = REPO / "run"
BUILD_ONCE = REPO / "launcher" / "build_once.sh"


def call(*command, env=None, **options):
    """Run a command to its end; `env` is added to the environment (None removes)."""
    full = {**os.environ, **(env or {})}
    full = {key: value for key, value in full.items() if value is not None}
    command = [str(word) for word in command]
    return subprocess.run(command, env=full, capture_output=True, text=True, **options)


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


# --- what the user types -----------------------------------------------------------------------


@pytest.mark.parametrize("words", [(), ("--help",)])
def test_help(words):
    done = call(RUN, *words)
    assert done.returncode == 0
    for form in ("./run demo NAME", "./run test", "./run lint", "UFL_ORIGAMI_ENV"):
        assert form in done.stdout


@pytest.mark.parametrize("name", ["no_such_demo", "../run", "-n", ""])
def test_unknown_demo_lists_the_demos(name):
    done = call(RUN, "demo", name)
    assert done.returncode == 2
    known = sorted(path.stem for path in (REPO / "demos").glob("[!_]*.py"))
    assert f"demos: {' '.join(known) or 'none'}" in done.stderr


@pytest.fixture
def clone(tmp_path):
    """A repository with the launcher, no package, and room for demos and tests."""
    for name in ("launcher", "run", "packages.txt", "pyproject.toml"):
        source, place = REPO / name, tmp_path / "a clone" / name
        place.parent.mkdir(exist_ok=True)
        shutil.copytree(source, place) if source.is_dir() else shutil.copy(source, place)
    for name in ("demos", "tests"):
        (place.parent / name).mkdir()
    return place.parent


def test_demo_gets_its_arguments_and_ranks(clone):
    script = "import os, sys; from mpi4py import MPI\n"
    script += "os.write(1, f'{MPI.COMM_WORLD.size} {sys.argv[1:]}\\n'.encode())"
    (clone / "demos" / "hello.py").write_text(script)
    assert call(clone / "run", "demo", "hello", "--a", "b c").stdout == "1 ['--a', 'b c']\n"
    two = call(clone / "run", "demo", "hello", "-n", "2", "-n")
    assert two.stdout == "2 ['-n']\n" * 2
    assert call(clone / "run", "demo", "hello", "-n", "two").returncode == 2


@pytest.mark.parametrize("choice", ["nonsense", "docker"])
def test_forced_environment_that_cannot_be_had_fails(choice):
    path = f"{Path(shutil.which('bash')).parent}" if choice == "nonsense" else os.environ["PATH"]
    if choice == "docker" and shutil.which("docker"):
        pytest.skip("Docker is installed here")
    done = call(RUN, "true", env={"UFL_ORIGAMI_ENV": choice, "PATH": path})
    assert done.returncode == 2
    assert "docker" in done.stderr


# --- the command is as without the launcher ----------------------------------------------------


def test_exit_code_words_input_and_folder(tmp_path):
    script = 'cat; printf "%s|" "$@" "$PWD"; exit 37'
    done = call(RUN, "bash", "-c", script, "x", "a b", "", "*", cwd=tmp_path, input="from stdin ")
    assert done.returncode == 37
    assert done.stdout == f"from stdin a b||*|{tmp_path}|"
    assert call(RUN, "no-such-command").returncode == 127


def test_interrupt_reaches_the_command(tmp_path):
    script = "import pathlib, time; pathlib.Path('up').touch(); time.sleep(60)"
    with subprocess.Popen([RUN, "python3", "-c", script], cwd=tmp_path, stderr=-3) as process:
        wait_for((tmp_path / "up").exists)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == -signal.SIGINT


def test_package_is_importable_from_anywhere(tmp_path):
    script = "import ufl_origami, sys; print(ufl_origami.__file__)"
    done = call(RUN, "python3", "-c", script, cwd=tmp_path, env={"PYTHONPATH": None})
    assert Path(done.stdout.strip()).parent == REPO / "ufl_origami"


def test_this_python_has_all_modules():
    done = call(sys.executable, REPO / "launcher" / "native.py")
    assert (done.returncode, done.stdout) == (0, "")


def test_python_without_dolfinx_is_refused():
    done = call(sys.executable, "-S", REPO / "launcher" / "native.py", env={"PYTHONPATH": None})
    assert "lacks dolfinx" in done.stdout


# --- building once -----------------------------------------------------------------------------


def builder(tmp_path, body):
    path = tmp_path / "builder.sh"
    path.write_text(f"set -e\nhere={tmp_path}\n{body}\n")
    return ["bash", str(BUILD_ONCE), str(tmp_path / "made"), "bash", str(path)]


def leftovers(tmp_path):
    return [path.name for path in tmp_path.iterdir() if ".part." in path.name]


GOOD = 'echo run >>"$here/count"; echo data >"$1/file"'


def test_build_is_made_once(tmp_path):
    for _ in range(2):
        assert call(*builder(tmp_path, GOOD)).returncode == 0
    assert (tmp_path / "made" / "file").read_text() == "data\n"
    assert (tmp_path / "count").read_text() == "run\n"


def test_two_builders_at_once_build_once(tmp_path):
    command = builder(tmp_path, GOOD + "; sleep 0.5")
    both = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    messages = [process.communicate()[1] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert (tmp_path / "count").read_text() == "run\n"
    assert sum("waiting" in text for text in messages) == 1


def test_failed_build_leaves_nothing_and_its_code(tmp_path):
    done = call(*builder(tmp_path, 'touch "$1/file"; echo reason; exit 7'))
    assert done.returncode == 7
    assert not (tmp_path / "made").exists()
    assert leftovers(tmp_path) == []
    assert (tmp_path / "made.log").read_text() == "reason\n"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_killed_build_is_never_trusted(tmp_path, number):
    slow = 'echo $$ >"$here/pid"; touch "$1/.ready"; mv "$here/pid" "$here/started"; sleep 60'
    with subprocess.Popen(builder(tmp_path, slow)) as process:
        wait_for((tmp_path / "started").exists)
        process.send_signal(number)
        process.wait(20)
    child = int((tmp_path / "started").read_text())
    wait_for(lambda: not Path(f"/proc/{child}").exists())
    assert not (tmp_path / "made").exists()
    assert call(*builder(tmp_path, GOOD)).returncode == 0
    assert (tmp_path / "made" / "file").exists()
    assert leftovers(tmp_path) == []


def test_unfinished_target_is_replaced(tmp_path):
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "stale").touch()
    assert call(*builder(tmp_path, GOOD)).returncode == 0
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == [".ready", "file"]


def test_change_of_owner_can_be_ignored(tmp_path):
    file = tmp_path / "file"
    file.touch()
    done = call("perl", REPO / "launcher" / "ignore_chown.pl", "chown", "4711:4711", file)
    assert done.returncode == 0, done.stderr
    assert (file.stat().st_uid, file.stat().st_gid) == (os.geteuid(), os.getegid())


# --- lint and tests ----------------------------------------------------------------------------


def test_lint_without_ruff_fails(clone, tmp_path):
    offline = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path), "PIP_CONFIG_FILE": os.devnull}
    hidden = {"PATH": "/usr/bin:/bin", "UFL_ORIGAMI_CACHE": str(tmp_path / "cache")}
    pin = (clone / "pyproject.toml").read_text().replace('required-version = "==', "&999.")
    (clone / "pyproject.toml").write_text(pin.replace("&", 'required-version = "=='))
    done = call("bash", clone / "launcher" / "lint.sh", env=offline | hidden)
    assert done.returncode != 0
    assert "nothing was linted" in done.stderr


MPI_TEST = """
import pytest
from mpi4py import MPI
@pytest.mark.mpi
def test_ranks():
    assert MPI.COMM_WORLD.size == 1 or {condition}
    MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.parametrize(
    ("condition", "code"), [("True", 0), ("False", 1), ("MPI.COMM_WORLD.rank == 0", 1)]
)
def test_one_exit_code_for_both_parts(clone, condition, code):
    (clone / "tests" / "test_it.py").write_text(MPI_TEST.format(condition=condition))
    done = call(clone / "run", "test", "-q", env={"UFL_ORIGAMI_MPI_PATIENCE": "1"}, timeout=60)
    assert done.returncode == code, done.stdout + done.stderr
    assert "1 passed" in done.stdout
    assert "two processes" in done.stderr


def test_no_test_selected_is_an_error(clone):
    (clone / "tests" / "test_it.py").write_text(MPI_TEST.format(condition="True"))
    assert call(clone / "run", "test", "-k", "nothing").returncode == 5


# --- the Debian root itself (built when it is absent) ------------------------------------------


@pytest.fixture(scope="module")
def root_env():
    flags = ["--mount"] if os.geteuid() == 0 else ["--user", "--map-root-user", "--mount"]
    if call("unshare", *flags, "mount", "-t", "tmpfs", "tmpfs", "/tmp").returncode:
        pytest.skip("no mount namespaces here")
    env = {"UFL_ORIGAMI_ENV": "root", "UFL_ORIGAMI_INSIDE": None}
    assert call(RUN, "true", env=env).returncode == 0
    return env


@pytest.mark.slow
def test_root_is_read_only_and_leaves_no_mount(root_env):
    before = Path("/proc/self/mounts").read_text()
    assert call(RUN, "touch", "/usr/x", env=root_env).returncode == 1
    assert Path("/proc/self/mounts").read_text() == before


@pytest.mark.slow
def test_root_keeps_user_and_files(root_env, tmp_path):
    script = "touch new; id -u; id -g"
    done = call(RUN, "bash", "-c", script, env=root_env, cwd=tmp_path)
    assert done.stdout.split() == [str(os.geteuid()), str(os.getegid())]
    assert (tmp_path / "new").stat().st_uid == os.geteuid()


@pytest.mark.slow
def test_root_starts_within_half_a_second(root_env):
    times = []
    for _ in range(5):
        start = time.perf_counter()
        call(RUN, "true", env=root_env)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.5
