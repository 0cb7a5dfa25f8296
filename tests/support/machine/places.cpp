// SPDX-License-Identifier: Apache-2.0
#include "tests/support/machine/places.h"

namespace palpate::test {

const std::string& source_dir() {
  static const std::string dir = PALPATE_SOURCE_DIR;
  return dir;
}

const std::string& binary_dir() {
  static const std::string dir = PALPATE_BINARY_DIR;
  return dir;
}

}  // namespace palpate::test
