#!/usr/bin/env bash
# Installs the Debian packages that Palpate is built from, as far as they are missing; asks nothing
# and says nothing when none is.
#
#   deploy/packages.sh            to build and run
#   deploy/packages.sh --tests    to build and run the tests too
#   deploy/packages.sh --package  to make a Debian package too
set -euo pipefail

packages=(
  cmake g++ ninja-build pkg-config
  cppzmq-dev libzmq3-dev
  libprotobuf-dev protobuf-compiler
  libboost-dev libboost-filesystem-dev
  libcli11-dev libeigen3-dev libspdlog-dev nlohmann-json3-dev zlib1g-dev
)
# npm builds the viewer's page; another distribution's Node.js may bring its own
command -v npm >/dev/null || packages+=(nodejs npm)
if [[ "${1:-}" == "--tests" ]]; then
  packages+=(chromium clang-format clang-tidy fonts-liberation gnuplot-nox iproute2 libgmock-dev libgtest-dev
    libnanoflann-dev)
fi
if [[ "${1:-}" == "--package" ]]; then packages+=(dpkg-dev); fi

# Elsewhere than on Debian, CMake names what is missing.
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
    echo "Missing packages, and neither root nor sudo to install them. As root:" >&2
    echo "  apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "Installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
