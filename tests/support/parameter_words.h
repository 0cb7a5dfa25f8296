// SPDX-License-Identifier: Apache-2.0
// parameter_words.h — the parameter of a test, as printed, in the test's name.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <string>

namespace palpate::test {

/// The number of the parameter, which makes the name unique, and its words: "3_faults_freeze".
template <class T>
std::string parameter_words(const testing::TestParamInfo<T>& info) {
  std::string name = std::to_string(info.index);
  bool begins_word = true;
  for (const char c : testing::PrintToString(info.param)) {
    const bool is_of_word = std::isalnum(static_cast<unsigned char>(c)) != 0;
    if (is_of_word && begins_word) name += '_';
    if (is_of_word) name += c;
    begins_word = !is_of_word;
  }
  return name;
}

}  // namespace palpate::test
