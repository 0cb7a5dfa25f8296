#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a bare Debian 12 to every test: installs what is missing, builds, runs. Ends with ctest's
# summary, of the first build that fails or of the last (--all: with the first pages).
#
#   tests/run.sh                   the release build, every test
#   tests/run.sh --ci              besides, before it: format and clang-tidy of what changed, mutation
#                                  testing of the controllers and the force guard; after
#                                  it: the tests that need no real time once more, with assertions
#                                  and under the address and undefined behaviour sanitizers
#   tests/run.sh --all             --ci, the thread sanitizer too, ten times as many seeds in the
#                                  release build, faults of the devices' wires in real time, an upgrade
#                                  of the Debian package, and the first pages in a fresh Debian (as
#                                  root)
#   tests/run.sh -R 'Codec'        further arguments go to each ctest
#   tests/run.sh --soak MINUTES [SEED]   instead: a long session with random faults
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

# Configures build/PRESET with tests, unless it is.
configure() {
  # demo.sh configures build/release without tests
  if [[ ! -f "build/$1/build.ninja" ]] ||
     ! grep -q '^PALPATE_BUILD_TESTS:BOOL=ON$' "build/$1/CMakeCache.txt"; then
    cmake --preset "$1" -DPALPATE_BUILD_TESTS=ON
  fi
}

"$root/deploy/packages.sh" --tests
cd "$root"

if [[ "${1:-}" == "--soak" ]]; then
  minutes="${2:?--soak MINUTES}"
  configure release
  cmake --build --preset release --parallel "$(nproc)" --target palpate_soak
  exec build/release/bin/palpate_soak "$minutes" "${3:-1}"
fi

presets=(release)
release_seeds="${PALPATE_SEEDS:-1}"
has_lint=false
is_all=false
case "${1:-}" in
  --ci)
    presets=(release asan)
    has_lint=true
    shift
    ;;
  --all)
    presets=(release asan tsan)
    release_seeds=10  # 10 000 runs of the guarantee
    export PALPATE_DEVICE_FAULTS=1
    has_lint=true
    is_all=true
    shift
    ;;
esac

if $has_lint; then
  configure release
  tests/lint.sh
  tests/mutation/run --quick
fi

if $is_all; then
  tests/package/upgrade
  if [[ "$(id -u)" -eq 0 ]]; then
    tests/first_pages/run
  else
    echo "not checked: the first pages in a fresh Debian (tests/first_pages/run needs root)"
  fi
fi

configure "${presets[0]}"
cmake --build --preset "${presets[0]}" --parallel "$(nproc)"
if $is_all; then cmake --build --preset release --parallel "$(nproc)" --target benches; fi

# The tests of a build. Before ctest's summary: the figures of real time that were not checked.
#   run_tests PRESET [CTEST ARGUMENTS]
run_tests() {
  local preset="$1" seeds="${PALPATE_SEEDS:-1}"
  shift
  if [[ "$preset" == release ]]; then seeds="$release_seeds"; fi
  PALPATE_SEEDS="$seeds" ctest --preset "$preset" --parallel "$(nproc)" "$@" |
    awk -v list="grep '^not checked: ' build/$preset/Testing/Temporary/LastTest.log | sort | uniq -c" '
      / tests passed, / { is_summary = 1 }
      is_summary { summary = summary $0 "\n"; next }
      { print; fflush() }
      END { fflush(); system(list); printf "%s", summary }'
}

for i in "${!presets[@]}"; do
  preset="${presets[i]}"
  next="${presets[i + 1]:-}"
  if [[ -n "$next" ]]; then
    # Many tests wait more than they compute. The next build takes what they leave of the processors
    # (SCHED_IDLE), in a process group that ends with this script.
    configure "$next"
    set -m
    chrt --idle 0 cmake --build --preset "$next" --parallel "$(nproc)" > "build/$next.log" 2>&1 &
    set +m
    next_build=$!
    trap 'kill -- "-$next_build" 2> /dev/null || true' EXIT
  fi
  if [[ -z "$next" ]]; then
    run_tests "$preset" "$@"
  else
    # the page needs what the compilers leave, so its tests come after them
    run_tests "$preset" --label-exclude '^web$' "$@"
    wait "$next_build" || { cat "build/$next.log"; exit 1; }
    trap - EXIT
    run_tests "$preset" --label-regex '^web$' "$@"
  fi
done
