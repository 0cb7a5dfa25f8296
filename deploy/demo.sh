#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a bare Debian 12 to a running session: installs missing packages, builds, launches.
# Arguments are passed to `palpate launch`:
#
#   deploy/demo.sh                 until Ctrl-C
#   deploy/demo.sh --seconds 10    ends after 10 s
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

"$root/deploy/packages.sh"

# tests/run.sh uses the same build folder: keep the configuration of an existing one
if [[ ! -f "$root/build/release/build.ninja" ]]; then
  (cd "$root" && cmake --preset release -DPALPATE_BUILD_TESTS=OFF)
fi
targets=(palpate device_node mofc_node device_mofc_node physics_node viewer_node)
if [[ "$(ninja -C "$root/build/release" -n "${targets[@]}")" != *"no work to do"* ]]; then
  cmake --build "$root/build/release" --parallel "$(nproc)" --target "${targets[@]}"
fi

exec "$root/build/release/bin/palpate" launch "$root/deploy/sessions/default.txtpb" "$@"
