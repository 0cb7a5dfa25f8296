// SPDX-License-Identifier: Apache-2.0
// places.h — where the tree and its programs are, compiled once: all that tests compile is the same
// in every clone, so that ccache knows it.
#pragma once

#include <string>

namespace palpate::test {

/// Root of the source tree.
const std::string& source_dir();

/// Folder of the built programs.
const std::string& binary_dir();

}  // namespace palpate::test
