#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds two Debian packages in build/package: palpate_VERSION_ARCH.deb, the programs with the systemd units,
# and palpate-dev_VERSION_ARCH.deb, the libraries and headers to build against. In the first is its
# software bill of materials, palpate.spdx.json.
# Arguments are passed to the configuration by cmake.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

"$root/deploy/packages.sh" --package
cmake --preset release -S "$root" -B "$root/build/package" \
  -DPALPATE_BUILD_TESTS=OFF -DPALPATE_SERVICE=ON "$@"
cmake --build "$root/build/package" --parallel "$(nproc)"
cd "$root/build/package"
version="$(sed -n 's/^CMAKE_PROJECT_VERSION:STATIC=//p' CMakeCache.txt)"
page=()  # of which the package has a part only if npm could build it
if [[ -s viewer_node/page/app.js.gz ]]; then page=(--lock "$root/viewer_node/web/package-lock.json"); fi
"$root/deploy/sbom" --version "$version" --build . "${page[@]}" \
  bin/palpate bin/palpate_tools bin/device_node bin/mofc_node bin/device_mofc_node bin/physics_node \
  bin/viewer_node lib/palpate/palpate_rivals.so > palpate.spdx.json
cpack
