// SPDX-License-Identifier: Apache-2.0
// check.h — assertions for programming errors. Errors of external input are reported by other
// means: an enum (network), a latched fault (device) or a SetupError (user).
#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

/// Checked in every build; aborts and prints the condition, file and line.
#define PALPATE_REQUIRE(condition)                                                           \
  do {                                                                                       \
    if (!(condition)) {                                                                      \
      std::fprintf(stderr, "%s:%d: broken invariant: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                          \
    }                                                                                        \
  } while (false)

/// As PALPATE_REQUIRE in builds without NDEBUG; nothing otherwise.
#ifdef NDEBUG
#define PALPATE_ASSERT(condition) static_cast<void>(0)
#else
#define PALPATE_ASSERT(condition) PALPATE_REQUIRE(condition)
#endif

namespace palpate {

/// An error that the user must correct before the loop can start: bad session, endpoint in use,
/// missing file. The text gives the setting, its value, the rule and the remedy; run_node prints it
/// once and exits with status 2.
class SetupError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace palpate
