// alloc_guard.h — counts what the current thread takes from the heap. It replaces operator new of
// the whole program: include it in exactly one source of a test executable.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace palpate {

inline thread_local std::uint64_t allocations_of_this_thread = 0;

/// Allocations since it was made:  AllocGuard guard; node.step(tick); EXPECT_EQ(guard.count(), 0u);
class AllocGuard {
 public:
  [[nodiscard]] std::uint64_t count() const { return allocations_of_this_thread - before_; }

 private:
  std::uint64_t before_ = allocations_of_this_thread;
};

}  // namespace palpate

// GCC sees free() meet new once it inlines these, not that they belong together.
#pragma GCC diagnostic push
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
#endif

void* operator new(std::size_t size) {
  ++palpate::allocations_of_this_thread;
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  ++palpate::allocations_of_this_thread;
  const auto align = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(align, (size + align - 1) / align * align)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

#pragma GCC diagnostic pop
