// SPDX-License-Identifier: Apache-2.0
// mutant.h — included by the mutated copies of sources that tests/mutation/run writes. All mutants
// are compiled in; the environment variable PALPATE_MUTANT chooses one, by its number, when the
// program starts. 0 or nothing: the original.
//
// PALPATE_MUTANTS_REACHED names a file of kMutants bytes: the byte of each mutant whose place was
// executed becomes 1.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <type_traits>

namespace palpate::mutation {

inline constexpr unsigned kMutants = 1U << 20U;

// Constant initialisation: a static initialiser that runs earlier sees the original.
inline unsigned char unread[kMutants] = {};
inline unsigned char* reached = unread;
inline unsigned chosen = 0;

struct Environment {
  Environment() {
    if (const char* number = std::getenv("PALPATE_MUTANT")) {
      chosen = static_cast<unsigned>(std::atoi(number));
    }
    if (const char* file = std::getenv("PALPATE_MUTANTS_REACHED")) {
      const int descriptor = open(file, O_RDWR | O_CLOEXEC);
      void* map = mmap(nullptr, kMutants, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
      if (map == MAP_FAILED) std::abort();
      reached = static_cast<unsigned char*>(map);
      close(descriptor);
    }
  }
};
inline const Environment environment;

/// Whether mutant `number` is to run in place of the original.
[[nodiscard]] constexpr bool on(unsigned number) noexcept {
  if (std::is_constant_evaluated()) return false;
  reached[number] = 1;
  return chosen == number;
}

/// Gives both sides of a choice one type: expressions of Eigen as values, others as they are.
template <class T>
[[nodiscard]] constexpr decltype(auto) value(T&& x) {
  if constexpr (requires { typename std::remove_cvref_t<T>::PlainObject; }) {
    return typename std::remove_cvref_t<T>::PlainObject(x);
  } else {
    return std::remove_cvref_t<T>(static_cast<T&&>(x));
  }
}

}  // namespace palpate::mutation
