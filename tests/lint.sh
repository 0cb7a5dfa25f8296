#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The format of every C++ file, and clang-tidy on those that changed. Ends with status 1 if there is
# anything to mend; needs build/release configured.
#
#   tests/lint.sh           what changed since the last commit but one, and what is not committed
#   tests/lint.sh BASE      what changed since the commit BASE
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

git ls-files '*.h' '*.cpp' | xargs clang-format --dry-run --Werror

# a clone may hold no more than one commit
base="${1:-}"
if [[ -z "$base" ]]; then
  base=$(git rev-parse --verify --quiet HEAD~1 || git rev-parse HEAD)
fi
# the examples of the controllers are a project of their own, which install_test builds
mapfile -t changed < <(git diff --name-only --diff-filter=d "$base" -- '*.cpp' \
  ':!mofc_node/controllers/examples')
[[ ${#changed[@]} -gt 0 ]] || exit 0

# One command per file, without GCC's precompiled headers; generated headers are those of
# build/release.
cmake --build --preset release --parallel "$(nproc)" --target palpate_generated
commands=$(mktemp -d)
trap 'rm -rf "$commands"' EXIT
cmake --preset release -B "$commands" -DPALPATE_BUILD_TESTS=ON -DPALPATE_UNITY=OFF \
  -DPALPATE_PRECOMPILE=OFF > "$commands/log" || { cat "$commands/log"; exit 1; }
sed -i "s#$commands/#$PWD/build/release/#g" "$commands/compile_commands.json"
echo "clang-tidy: ${#changed[@]} changed files since ${base:0:12}"
printf '%s\n' "${changed[@]}" |
  xargs -P "$(nproc)" -n 1 clang-tidy -p "$commands" --quiet --warnings-as-errors='*' 2> >(
    grep -v 'warnings generated' >&2)
