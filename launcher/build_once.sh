#!/usr/bin/env bash
# Build a folder exactly once: bash build_once.sh TARGET COMMAND...
#
# COMMAND is called with the name of a new folder beside TARGET, which it fills. When it succeeds the
# folder is marked by a file .ready and renamed to TARGET, in this order, so that TARGET is complete
# or absent, whatever is killed. A lock makes a second builder wait for the first. What a dead build
# left behind is renamed (at once) and then deleted in the background. The output of COMMAND goes to
# TARGET.log, except what it writes to descriptor 3.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"

discard() {
    local old trash
    for old in "$@"; do
        [[ -e $old ]] || continue
        trash=$target.trash.$$.$RANDOM
        if mv -T -- "$old" "$trash"; then
            (setsid rm -rf -- "$trash" </dev/null >/dev/null 2>&1 9>&- &)
        fi
    done
}

stop() {
    local status=$?
    trap - EXIT INT TERM HUP
    if [[ -n ${builder:-} ]]; then
        kill -KILL "$builder" 2>/dev/null && wait "$builder" 2>/dev/null || true
    fi
    discard "$part"
    exit "$status"
}

target=$1
part=$target.part.$$
shift
exec 9>"$target.lock"
if ! flock -n 9; then
    say "another process is building ${target##*/}; waiting for it"
    flock 9
fi
[[ ! -e $target/.ready ]] || exit 0

discard "$target" "$target".part.* "$target".trash.*
trap stop EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM
mkdir "$part"
# The builder dies with this process, even by kill -9, and does not hold the lock.
setpriv --pdeathsig KILL -- "$@" "$part" 3>&2 >"$target.log" 2>&1 9>&- &
builder=$!
wait "$builder"
builder=
sync -f "$part"
touch "$part/.ready"
sync "$part/.ready"
mv -T -- "$part" "$target"
trap - EXIT
