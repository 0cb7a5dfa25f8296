// check.h — the programmer's own mistakes. Never for input from outside: that gets an enum
// (network), a latched fault (device) or a SetupError (user).
#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

/// Always checked; aborts with the condition and its place.
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

/// The user's problem, before the loop starts: bad session, endpoint in use, file missing.
/// The text names what, value, rule and remedy; run_node prints it once and exits with status 2.
class SetupError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace palpate
