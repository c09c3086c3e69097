#!/usr/bin/env bash
# Become COMMAND in a container: bash container.sh ENGINE NAME COMMAND...
#
# The image is built from the Dockerfile when there is none called ufl_origami:NAME. The container
# sees the folders that the user works in under their own names, and runs as the user.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"
engine=$1 image=ufl_origami:$2
shift 2

command -v "$engine" >/dev/null || fail "there is no $engine on this machine"
if ! "$engine" image inspect "$image" >/dev/null 2>&1; then
    "$engine" info >/dev/null 2>&1 || fail "$engine does not answer; is it running, and may you use it?"
    say "building the image $image"
    proxies=()
    for name in http_proxy https_proxy no_proxy; do
        if [[ -n ${!name:-} ]]; then proxies+=(--build-arg "$name=${!name}"); fi
    done
    "$engine" build "${proxies[@]}" -t "$image" "$repo" >&2 ||
        fail "the image could not be built; the lines above say why"
fi

mkdir -p "$UFL_ORIGAMI_CACHE"
options=(--rm --init --interactive --ipc host --workdir "$PWD" --env "HOME=${HOME:-/}")
options+=(--env UFL_ORIGAMI_CACHE --env "UFL_ORIGAMI_INSIDE=${image#*:}" --env LANG=C.UTF-8)
if [[ -t 0 && -t 1 ]]; then options+=(--tty); fi
if [[ $engine == podman ]]; then options+=(--userns keep-id); fi
options+=(--user "$(id -u):$(id -g)")
for name in OMP_NUM_THREADS TERM TZ http_proxy https_proxy no_proxy; do
    if [[ -n ${!name:-} ]]; then options+=(--env "$name"); fi
done
mapfile -t folders < <(printf '%s\n' "$PWD" "${HOME:-/tmp}" "$repo" "$UFL_ORIGAMI_CACHE" /tmp | sort -u)
for folder in "${folders[@]}"; do
    options+=(--volume "$folder:$folder")
done
# The image's own python3 has all that is needed; the launcher of this repository sets the rest.
exec "$engine" run "${options[@]}" "$image" "$repo/run" "$@"
