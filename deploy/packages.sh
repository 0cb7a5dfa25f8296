#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the missing Debian packages of Palpate's build without asking; prints nothing if there are
# none. While another program installs packages it waits, and says so. Services that come with the
# packages (nginx, munge, Slurm, for the tests) are neither started nor enabled.
#
#   deploy/packages.sh            to build and run
#   deploy/packages.sh --tests    to build and run the tests too
#   deploy/packages.sh --load     to run the tests on a busy machine too
#   deploy/packages.sh --package  to make a Debian package too
#   deploy/packages.sh --container to make the root of a container too
set -euo pipefail

packages=(
  cmake g++ ninja-build pkg-config
  cppzmq-dev libzmq3-dev
  libprotobuf-dev protobuf-compiler
  libboost-dev libboost-filesystem-dev
  libcli11-dev libeigen3-dev libexpat1-dev libspdlog-dev nlohmann-json3-dev zlib1g-dev
)
# npm builds the page of the viewer; a Node.js from elsewhere may contain it
command -v npm >/dev/null || packages+=(nodejs npm)
if [[ "${1:-}" == "--tests" || "${1:-}" == "--load" ]]; then
  packages+=(calculix-ccx chromium clang-format clang-tidy cvc5 cyclonedds-dev cyclonedds-tools doxygen fonts-liberation gnuplot-nox iproute2
    libbullet-dev libdcmtk-dev libfastcdr-dev libfastrtps-dev libgmock-dev libgtest-dev libmujoco-dev libnanoflann-dev libopenigtlink-dev
    mricron-data munge nginx python3-clang python3-h5py python3-nibabel python3-numpy python3-pip python3-protobuf python3-zmq
    slurm-wlm teem-apps z3)
fi
if [[ "${1:-}" == "--load" ]]; then packages+=(stress-ng); fi
if [[ "${1:-}" == "--package" ]]; then packages+=(dpkg-dev); fi
if [[ "${1:-}" == "--container" ]]; then packages+=(mmdebstrap); fi

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

# apt-get with these arguments. Waits while another program holds a lock of dpkg or apt.
apt_get() {
  local errors has_said=false
  errors="$(mktemp)"
  until "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq "$@" > /dev/null 2> "$errors"; do
    if ! grep -qE 'Could not get lock|Unable to (acquire|lock)' "$errors"; then
      cat "$errors" >&2
      rm "$errors"
      return 1
    fi
    if ! $has_said; then
      echo "Waiting: another program is installing packages ($(grep -oE 'process [0-9]+ \([^)]*\)' "$errors" || echo "a lock is held"))"
      has_said=true
    fi
    sleep 2
  done
  rm "$errors"
}

# Debian starts a service as it is installed unless this program forbids it, and at each boot unless
# it is disabled.
policy=/usr/sbin/policy-rc.d
services=()
for service in nginx munge slurmctld slurmd; do
  [[ -e "/lib/systemd/system/$service.service" ]] || services+=("$service")
done
has_policy=false
allow_services() {
  if $has_policy; then "${as_root[@]}" rm -f "$policy"; fi
}
trap allow_services EXIT

echo "Installing ${missing[*]}"
apt_get update
if [[ ! -e "$policy" ]]; then
  printf '#!/bin/sh\nexit 101\n' | "${as_root[@]}" tee "$policy" > /dev/null
  has_policy=true
  "${as_root[@]}" chmod 755 "$policy"
fi
apt_get install -y --no-install-recommends "${missing[@]}"
left_off=()
for service in "${services[@]}"; do
  [[ ! -e "/lib/systemd/system/$service.service" ]] || left_off+=("$service")
done
if [[ ${#left_off[@]} -gt 0 ]]; then
  if command -v systemctl > /dev/null; then "${as_root[@]}" systemctl disable --quiet "${left_off[@]}"; fi
  echo "Not started, and not at boot: ${left_off[*]} (the tests start their own)"
fi
