#!/usr/bin/env bash
# Installs the missing Debian packages of Palpate's build without asking; prints nothing if there are
# none.
#
#   deploy/packages.sh            to build and run
#   deploy/packages.sh --tests    to build and run the tests too
#   deploy/packages.sh --load     to run the tests on a busy machine too
#   deploy/packages.sh --package  to make a Debian package too
set -euo pipefail

packages=(
  cmake g++ ninja-build pkg-config
  cppzmq-dev libzmq3-dev
  libprotobuf-dev protobuf-compiler
  libboost-dev libboost-filesystem-dev
  libcli11-dev libeigen3-dev libspdlog-dev nlohmann-json3-dev zlib1g-dev
)
# npm builds the page of the viewer; a Node.js from elsewhere may contain it
command -v npm >/dev/null || packages+=(nodejs npm)
if [[ "${1:-}" == "--tests" || "${1:-}" == "--load" ]]; then
  packages+=(calculix-ccx chromium clang-format clang-tidy cvc5 fonts-liberation gnuplot-nox iproute2
    libbullet-dev libgmock-dev libgtest-dev libmujoco-dev libnanoflann-dev munge nginx python3-clang python3-numpy
    python3-pip python3-protobuf python3-zmq slurm-wlm z3)
fi
if [[ "${1:-}" == "--load" ]]; then packages+=(stress-ng); fi
if [[ "${1:-}" == "--package" ]]; then packages+=(dpkg-dev); fi

# On other systems CMake names what is missing.
command -v dpkg-query >/dev/null || exit 0

installed="$(dpkg-query --show --showformat=' ${Package} ${db:Status-Status} ' "${packages[@]}" \
               2>/dev/null || true)"
missing=()
for package in "${packages[@]}"; do
  [[ "$installed" == *" $package installed "* ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

as_root=()
if [[ "$(id -u)" -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "Packages are missing; without sudo only root can install them:" >&2
    echo "  apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "Installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
