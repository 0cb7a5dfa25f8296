#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the root file system of a container with Palpate, build/package/palpate.tar: Debian 12 and the package
# palpate, nothing else. deploy/Containerfile makes an image of it. Needs no container program; needs root, or
# user namespaces.
# Arguments are passed to mmdebstrap, e.g. a mirror.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

"$root/deploy/package.sh"
"$root/deploy/packages.sh" --container
cd "$root/build/package"
package="$(ls -t palpate_*.deb | head -1)"
# shellcheck disable=SC2016  # the hooks' $1 is the new root
mmdebstrap --variant=apt --quiet \
  --customize-hook="upload $package /tmp/palpate.deb" \
  --customize-hook='chroot "$1" apt-get install --yes -qq --no-install-recommends /tmp/palpate.deb > /dev/null' \
  --customize-hook='rm "$1/tmp/palpate.deb"' \
  bookworm palpate.tar "$@"
cp "$root/deploy/Containerfile" .
echo "build/package/palpate.tar; an image: podman build -t palpate build/package"
