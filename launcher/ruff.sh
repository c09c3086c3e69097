#!/usr/bin/env bash
# Print the path of ruff in the version that pyproject.toml requires; install it when it is missing.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"

version=$(sed -n 's/^required-version = "==\(.*\)"$/\1/p' "$repo/pyproject.toml")
[[ -n $version ]] || fail "pyproject.toml does not pin ruff (required-version)"
if [[ $(ruff --version 2>/dev/null) == "ruff $version" ]]; then
    command -v ruff
    exit 0
fi
target=$UFL_ORIGAMI_CACHE/ruff-$version-$(uname -m)
if [[ ! -e $target/.ready ]]; then
    mkdir -p "$UFL_ORIGAMI_CACHE"
    say "installing ruff $version"
    bash "$repo/launcher/build_once.sh" "$target" \
        python3 -m pip install --no-deps --no-input "ruff==$version" --target || {
        tail -n 5 "$target.log" >&2
        fail "ruff $version could not be installed by pip (log: $target.log); nothing was linted"
    }
fi
echo "$target/bin/ruff"
