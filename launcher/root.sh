#!/usr/bin/env bash
# Build the Debian root file system TARGET/root, once, and explain a failure: bash root.sh TARGET
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"
target=$1
log=$target.log

# The builder runs as root of a namespace of its own: what it mounts and starts ends with it.
in_namespace() {
    local flags=(--mount --pid --fork --kill-child --mount-proc) shell=(bash)
    if ((EUID != 0)); then
        flags+=(--user --map-root-user)
        shell=(perl "$repo/launcher/ignore_chown.pl" bash)
    fi
    bash "$repo/launcher/build_once.sh" "$target" \
        unshare "${flags[@]}" "${shell[@]}" "$repo/launcher/build_root.sh"
}

explain() {
    tail -n 15 "$log" | sed 's/^/  | /' >&2
    say "the environment could not be built; nothing half-made is kept. The whole log: $log"
    if grep -qi 'no space left\|disk quota exceeded' "$log"; then
        say "The disk is full. Free 5 GB below ${target%/*}, or set UFL_ORIGAMI_CACHE to a folder" \
            "on another disk, and run the same command again."
    elif grep -qi "resol\|connect\|timed out\|failed to fetch\|couldn't download\|proxy" "$log"; then
        say "The Debian mirror could not be reached. Check the network and http_proxy, or set" \
            "UFL_ORIGAMI_MIRROR to the URL of a mirror, and run the same command again."
    else
        say "Run the same command again; or use Docker or Podman with UFL_ORIGAMI_ENV=docker."
    fi
}

export PATH=$PATH:/usr/sbin:/sbin
for tool in unshare setpriv flock mount pivot_root perl tar sha256sum; do
    command -v "$tool" >/dev/null || fail "building the environment needs the program '$tool'"
done
say "building the environment (once; some minutes, 4 GB in $target; log: $log)"
SECONDS=0
status=0
in_namespace || status=$?
if ((status == 0)); then
    say "the environment is ready after $SECONDS s"
    for old in "${target%-*}"-*/; do
        [[ $old == "$target/" ]] || say "an older one may be deleted: $old"
    done
elif ((status > 128)); then
    say "the build was interrupted; nothing half-made will be used. Run the same command again."
else
    explain
    status=1
fi
exit "$status"
