#!/usr/bin/env bash
# Run the tests without MPI, then those marked mpi on two processes: bash test.sh [PYTEST ARGS]
# -m EXPRESSION selects in both parts; without it the slow tests are left out. The first part shares
# the test files among as many workers as there are cores, four at most (-n N: so many; -n 0: none).
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"
limit=${UFL_ORIGAMI_MPI_TIMEOUT:-3600} # seconds, for a hang that the plugin does not see

selection="not slow"
arguments=()
workers=(-n auto --maxprocesses 4 --dist loadfile)
parts=2
while (($#)); do
    case $1 in
        -m) selection=${2:?-m needs an expression}; shift ;;
        -m?*) selection=${1#-m} ;;
        -n) workers=(-n "${2:?-n needs a number}" --dist loadfile); shift ;;
        -h | --help | --version | --co | --collect-only | --markers | --fixtures | --pdb)
            parts=1; workers=(-n 0); arguments+=("$1") ;;
        -s | --capture=no) workers=(-n 0); arguments+=("$1") ;;
        *) arguments+=("$1") ;;
    esac
    shift
done

cd "$repo"
export OMPI_MCA_mpi_yield_when_idle=1 # ranks that wait leave their cores to others
serial=0
python3 -m pytest "${workers[@]}" -m "$selection" "${arguments[@]}" || serial=$?
# From 2 on pytest was interrupted, misused, or found no test: the second part would do the same.
if ((parts == 1 || serial > 1)); then exit "$serial"; fi

say "the tests marked mpi, on two processes"
parallel=0
timeout --foreground -k 10 "$limit" mpirun -n 2 python3 -m pytest -p launcher.pytest_mpi \
    -p no:cacheprovider -m "mpi and not serial and ($selection)" "${arguments[@]}" || parallel=$?
if ((parallel == 124)); then say "the tests on two processes took longer than $limit s"; fi
exit $((serial ? serial : parallel))
