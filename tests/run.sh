#!/usr/bin/env bash
# From a bare Debian 12 to every test: installs what is missing, builds, runs. The release build
# first, then the tests without real time under the address and undefined behaviour sanitizers.
# Ends with ctest's summary, of the first build that fails or of the last.
#
#   tests/run.sh                   release and sanitizers
#   tests/run.sh --all             the thread sanitizer too, and ten times as many seeds in release
#   tests/run.sh -R 'Codec'        further arguments go to each ctest
#   tests/run.sh --soak MINUTES [SEED]   instead: a long session with faults at random
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

presets=(release asan)
if [[ "${1:-}" == "--soak" ]]; then
  minutes="${2:?--soak MINUTES}"
  "$root/deploy/packages.sh" --tests
  cd "$root"
  cmake --preset release -DPALPATE_BUILD_TESTS=ON
  cmake --build --preset release --parallel "$(nproc)" --target palpate_soak
  exec build/release/bin/palpate_soak "$minutes" "${3:-1}"
fi
release_seeds="${PALPATE_SEEDS:-1}"
if [[ "${1:-}" == "--all" ]]; then
  presets+=(tsan)
  release_seeds=10  # 10 000 runs of the guarantee
  shift
fi

"$root/deploy/packages.sh" --tests
cd "$root"
for preset in "${presets[@]}"; do
  # demo.sh configures build/release without tests
  if [[ ! -f "build/$preset/build.ninja" ]] ||
     ! grep -q '^PALPATE_BUILD_TESTS:BOOL=ON$' "build/$preset/CMakeCache.txt"; then
    cmake --preset "$preset" -DPALPATE_BUILD_TESTS=ON
  fi
  cmake --build --preset "$preset" --parallel "$(nproc)"
  seeds="${PALPATE_SEEDS:-1}"
  if [[ "$preset" == release ]]; then seeds="$release_seeds"; fi
  PALPATE_SEEDS="$seeds" ctest --preset "$preset" --parallel "$(nproc)" "$@"
done
