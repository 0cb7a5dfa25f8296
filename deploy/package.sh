#!/usr/bin/env bash
# Builds the Debian package with the systemd units: build/package/palpate_VERSION_ARCH.deb.
# Arguments are passed to the configuration by cmake.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

"$root/deploy/packages.sh" --package
cmake --preset release -S "$root" -B "$root/build/package" \
  -DPALPATE_BUILD_TESTS=OFF -DPALPATE_SERVICE=ON "$@"
cmake --build "$root/build/package" --parallel "$(nproc)"
cd "$root/build/package"
cpack
