// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/linear/dense_kernels.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace palpate::elastic {
namespace {

#define PALPATE_INLINE [[gnu::always_inline]] inline

template <class Scalar>
struct Products {
  using Product = void (*)(const Scalar* m, int n, int columns, const Scalar* x, Scalar* y);
  Product multiply;
  Product transposed;
  Product together;
  Product transposed_together;
};
/// Of one instruction set.
struct Kernels {
  int bytes;  // of a vector
  bool (*factor)(double* a, int n, int pivots);
  void (*invert)(double* a, int n, int pivots);
  void (*add_three)(const float* m, int n, const float* x, float* y);
  Products<float> floats;
  Products<double> doubles;
};

namespace baseline {
#define PALPATE_VECTOR_BYTES 16
#include "physics_node/elastic/linear/dense_kernels_of_set.inc"
#undef PALPATE_VECTOR_BYTES
}  // namespace baseline

// Vectors that are wider than the registers would be split through memory: ten times slower.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define PALPATE_HAS_SETS
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v3")
namespace avx2 {
#define PALPATE_VECTOR_BYTES 32
#include "physics_node/elastic/linear/dense_kernels_of_set.inc"
#undef PALPATE_VECTOR_BYTES
}  // namespace avx2
#pragma GCC pop_options
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v4")
namespace avx512 {
#define PALPATE_VECTOR_BYTES 64
#include "physics_node/elastic/linear/dense_kernels_of_set.inc"
#undef PALPATE_VECTOR_BYTES
}  // namespace avx512
#pragma GCC pop_options
#endif

/// The widest that this processor has.
const Kernels& kernels_of(int most_bytes) {
#ifdef PALPATE_HAS_SETS
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                        __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") &&
                          __builtin_cpu_supports("avx512bw") &&
                          __builtin_cpu_supports("avx512cd") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  if (has_avx512 && most_bytes >= avx512::kKernels.bytes) return avx512::kKernels;
  if (has_avx2 && most_bytes >= avx2::kKernels.bytes) return avx2::kKernels;
#endif
  static_cast<void>(most_bytes);
  return baseline::kKernels;
}

constexpr int kWidest = 64;
std::atomic<const Kernels*> in_use{nullptr};

const Kernels& kernels() {
  const Kernels* chosen = in_use.load(std::memory_order_relaxed);
  if (chosen == nullptr) {
    chosen = &kernels_of(kWidest);
    in_use.store(chosen, std::memory_order_relaxed);
  }
  return *chosen;
}

}  // namespace

int limit_vectors(int most_bytes) {
  const Kernels& chosen = kernels_of(most_bytes);
  in_use.store(&chosen, std::memory_order_relaxed);
  return chosen.bytes;
}

bool partial_cholesky(double* a, int n, int pivots) { return kernels().factor(a, n, pivots); }
void invert_pivots(double* a, int n, int pivots) { kernels().invert(a, n, pivots); }
void add_three(const float* m, int n, const float* x, float* y) { kernels().add_three(m, n, x, y); }
void multiply(const float* m, int n, int columns, const float* x, float* y) {
  kernels().floats.multiply(m, n, columns, x, y);
}
void multiply(const double* m, int n, int columns, const double* x, double* y) {
  kernels().doubles.multiply(m, n, columns, x, y);
}
void multiply_transposed(const float* m, int n, int columns, const float* x, float* y) {
  kernels().floats.transposed(m, n, columns, x, y);
}
void multiply_transposed(const double* m, int n, int columns, const double* x, double* y) {
  kernels().doubles.transposed(m, n, columns, x, y);
}
void multiply_together(const float* m, int n, int columns, const float* x, float* y) {
  kernels().floats.together(m, n, columns, x, y);
}
void multiply_together(const double* m, int n, int columns, const double* x, double* y) {
  kernels().doubles.together(m, n, columns, x, y);
}
void multiply_transposed_together(const float* m, int n, int columns, const float* x, float* y) {
  kernels().floats.transposed_together(m, n, columns, x, y);
}
void multiply_transposed_together(const double* m, int n, int columns, const double* x, double* y) {
  kernels().doubles.transposed_together(m, n, columns, x, y);
}

}  // namespace palpate::elastic
