// SPDX-License-Identifier: Apache-2.0
// text.h — changing a text for a test.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace palpate::test {

/// The text with the first `from` replaced; fails the test if there is none.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

}  // namespace palpate::test
