#!/usr/bin/env bash
# Run ruff and mypy on the repository, both always, with one exit code.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"

cd "$repo"
ruff=$(bash "$repo/launcher/ruff.sh")
status=0
"$ruff" check . || status=1
python3 -m mypy || status=1
exit "$status"
