// SPDX-License-Identifier: Apache-2.0
// alloc_guard.h — "does not allocate" as a test. Link palpate::alloc_guard: it replaces operator
// new and malloc of the whole executable by counting ones.
#pragma once

#include <cstdint>

namespace palpate::test {

/// operator new calls of this thread so far.
[[nodiscard]] std::uint64_t allocations_of_this_thread() noexcept;

/// malloc, calloc, realloc and aligned_alloc calls of this thread so far, those of shared libraries
/// and of operator new included. Always 0 in a build with a sanitizer, which has its own malloc.
[[nodiscard]] std::uint64_t mallocs_of_this_thread() noexcept;

/// Counts the operator new calls of this thread from its construction on.
class AllocGuard {
 public:
  AllocGuard() noexcept : before_(allocations_of_this_thread()) {}
  [[nodiscard]] std::uint64_t count() const noexcept {
    return allocations_of_this_thread() - before_;
  }

 private:
  std::uint64_t before_;
};

}  // namespace palpate::test
