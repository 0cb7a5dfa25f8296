// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/linear/dense_kernels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "common/contact/elastic/clones.h"

namespace palpate::elastic {
namespace {

#define PALPATE_INLINE [[gnu::always_inline]] inline

template <class Scalar>
struct VectorOf;
template <>
struct VectorOf<double> {
  using Type = double __attribute__((vector_size(64)));
};
template <>
struct VectorOf<float> {
  using Type = float __attribute__((vector_size(64)));
};
using Lanes = VectorOf<double>::Type;
constexpr std::ptrdiff_t kWide = 8;

template <class Vector, class Scalar>
PALPATE_INLINE Vector load(const Scalar* from) {
  Vector lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
template <class Vector, class Scalar>
PALPATE_INLINE void store(const Vector& lanes, Scalar* to) {
  std::memcpy(to, &lanes, sizeof lanes);
}

PALPATE_INLINE double* column(double* a, std::ptrdiff_t ld, std::ptrdiff_t j) { return a + ld * j; }

// c(rows, 4 columns at j) −= Σₖ l(rows, k) l(j…, k)ᵀ over `depth` columns of l, rows in packs
template <int kPacks>
PALPATE_INLINE void update_tile(double* a, std::ptrdiff_t ld, std::ptrdiff_t row, std::ptrdiff_t j,
                                int first, int depth) {
  Lanes sum[4][kPacks];
  for (int c = 0; c < 4; ++c) {
    for (int p = 0; p < kPacks; ++p)
      sum[c][p] = load<Lanes>(column(a, ld, j + c) + row + p * kWide);
  }
  for (int k = first; k < first + depth; ++k) {
    const double* l = column(a, ld, k);
    Lanes left[kPacks];
    for (int p = 0; p < kPacks; ++p) left[p] = load<Lanes>(l + row + p * kWide);
    for (int c = 0; c < 4; ++c) {
      for (int p = 0; p < kPacks; ++p) sum[c][p] -= left[p] * l[j + c];
    }
  }
  for (int c = 0; c < 4; ++c) {
    for (int p = 0; p < kPacks; ++p) store(sum[c][p], column(a, ld, j + c) + row + p * kWide);
  }
}

template <int kPacks>
PALPATE_INLINE void update_column(double* a, std::ptrdiff_t ld, std::ptrdiff_t row,
                                  std::ptrdiff_t j, int first, int depth) {
  Lanes sum[kPacks];
  for (int p = 0; p < kPacks; ++p) sum[p] = load<Lanes>(column(a, ld, j) + row + p * kWide);
  for (int k = first; k < first + depth; ++k) {
    const double* l = column(a, ld, k);
    for (int p = 0; p < kPacks; ++p) sum[p] -= load<Lanes>(l + row + p * kWide) * l[j];
  }
  for (int p = 0; p < kPacks; ++p) store(sum[p], column(a, ld, j) + row + p * kWide);
}

PALPATE_CLONES bool factor_columns(double* a, int n, int pivots) {
  constexpr int kBlock = 48;
  const std::ptrdiff_t ld = padded(n);
  for (int first = 0; first < pivots; first += kBlock) {
    const int end = std::min(first + kBlock, pivots);
    // the columns of the block, over all rows
    for (int j = first; j < end; ++j) {
      std::ptrdiff_t row = j / kWide * kWide;
      for (; row + 4 * kWide <= ld; row += 4 * kWide) {
        update_column<4>(a, ld, row, j, first, j - first);
      }
      for (; row < ld; row += kWide) update_column<1>(a, ld, row, j, first, j - first);
      double* c = column(a, ld, j);
      if (!(c[j] > 0.0) || !std::isfinite(c[j])) return false;
      const double root = std::sqrt(c[j]);
      const double inverse = 1.0 / root;
      for (int i = j + 1; i < ld; ++i) c[i] *= inverse;
      c[j] = root;
    }
    // what they take from the columns to the right
    int j = end;
    for (; j + 4 <= n; j += 4) {
      std::ptrdiff_t row = j / kWide * kWide;
      for (; row + 3 * kWide <= ld; row += 3 * kWide)
        update_tile<3>(a, ld, row, j, first, end - first);
      for (; row < ld; row += kWide) update_tile<1>(a, ld, row, j, first, end - first);
    }
    for (; j < n; ++j) {
      for (std::ptrdiff_t row = j / kWide * kWide; row < ld; row += kWide) {
        update_column<1>(a, ld, row, j, first, end - first);
      }
    }
  }
  return true;
}

PALPATE_CLONES void invert_columns(double* a, int n, int pivots) {
  const std::ptrdiff_t ld = padded(n);
  // X L₁₁ = [I; L₂₁], from the last column to the first: xⱼ = (bⱼ − Σ_{k>j} xₖ lₖⱼ) / lⱼⱼ
  for (int j = pivots - 1; j >= 0; --j) {
    double* c = column(a, ld, j);
    const double inverse = 1.0 / c[j];
    double l[kMostPivots];  // NOLINT: the multipliers, from rows that the inverse overwrites
    for (int k = j + 1; k < pivots; ++k) {
      l[k] = c[k] * inverse;
      c[k] = 0.0;
    }
    for (int i = pivots; i < n; ++i) c[i] *= inverse;
    c[j] = inverse;
    for (std::ptrdiff_t row = (j + 1) / kWide * kWide; row < ld; row += kWide) {
      Lanes sum = load<Lanes>(c + row);
      // column k begins at its diagonal
      const auto last = static_cast<int>(std::min<std::ptrdiff_t>(pivots, row + kWide));
      for (int k = j + 1; k < last; ++k) sum -= load<Lanes>(column(a, ld, k) + row) * l[k];
      store(sum, c + row);
    }
    for (int i = 0; i < j; ++i) c[i] = 0.0;
    for (int i = n; i < ld; ++i) c[i] = 0.0;
  }
}

template <class Scalar>
PALPATE_INLINE void multiply_any(const Scalar* m, int n, int columns, const Scalar* x, Scalar* y) {
  using Vector = typename VectorOf<Scalar>::Type;
  constexpr int kStep = 64 / sizeof(Scalar);
  const auto ld = static_cast<std::ptrdiff_t>(padded(n));
  for (std::ptrdiff_t r = 0; r < ld; r += kStep) store(Vector{}, y + r);
  int c = 0;
  for (; c + 8 <= columns; c += 8, m += 8 * ld) {
    for (std::ptrdiff_t r = 0; r < ld; r += kStep) {
      Vector even = load<Vector>(y + r) + load<Vector>(m + r) * x[c];
      Vector odd = load<Vector>(m + ld + r) * x[c + 1];
      for (int k = 2; k < 8; k += 2) {
        even += load<Vector>(m + k * ld + r) * x[c + k];
        odd += load<Vector>(m + (k + 1) * ld + r) * x[c + k + 1];
      }
      store(Vector(even + odd), y + r);
    }
  }
  for (; c < columns; ++c, m += ld) {
    for (std::ptrdiff_t r = 0; r < ld; r += kStep) {
      store(Vector(load<Vector>(y + r) + load<Vector>(m + r) * x[c]), y + r);
    }
  }
}

template <class Scalar>
PALPATE_INLINE Scalar sum_of(const typename VectorOf<Scalar>::Type& lanes) {
  constexpr int kStep = 64 / sizeof(Scalar);
  Scalar part[kStep];
  store(lanes, part);
  for (int width = kStep / 2; width > 0; width /= 2) {
    for (int i = 0; i < width; ++i) part[i] += part[i + width];
  }
  return part[0];
}

template <class Scalar>
PALPATE_INLINE void multiply_transposed_any(const Scalar* m, int n, int columns, const Scalar* x,
                                            Scalar* y) {
  using Vector = typename VectorOf<Scalar>::Type;
  constexpr int kStep = 64 / sizeof(Scalar);
  const auto ld = static_cast<std::ptrdiff_t>(padded(n));
  int c = 0;
  for (; c + 8 <= columns; c += 8, m += 8 * ld) {
    Vector sum[8];
    for (auto& s : sum) s = Vector{};
    for (std::ptrdiff_t r = 0; r < ld; r += kStep) {
      const Vector right = load<Vector>(x + r);
      for (int k = 0; k < 8; ++k) sum[k] += load<Vector>(m + k * ld + r) * right;
    }
    for (int k = 0; k < 8; ++k) y[c + k] = sum_of<Scalar>(sum[k]);
  }
  for (; c < columns; ++c, m += ld) {
    Vector sum = {};
    for (std::ptrdiff_t r = 0; r < ld; r += kStep) sum += load<Vector>(m + r) * load<Vector>(x + r);
    y[c] = sum_of<Scalar>(sum);
  }
}

// One number of each of the vectors that are multiplied together.
template <class Scalar>
struct TogetherOf;
template <>
struct TogetherOf<double> {
  using Type = double __attribute__((vector_size(kTogether * sizeof(double))));
};
template <>
struct TogetherOf<float> {
  using Type = float __attribute__((vector_size(kTogether * sizeof(float))));
};

// `kRows` rows of Y = M X or Mᵀ X, sums over the other index of M: `to_row` and `to_term` are the
// steps in M along each.
template <int kRows, class Scalar>
PALPATE_INLINE void sum_together(const Scalar* m, std::ptrdiff_t to_row, std::ptrdiff_t to_term,
                                 int terms, const Scalar* x, Scalar* y) {
  using Vector = typename TogetherOf<Scalar>::Type;
  Vector sum[kRows];
  for (int r = 0; r < kRows; ++r) sum[r] = Vector{};
  for (int t = 0; t < terms; ++t, m += to_term, x += kTogether) {
    const Vector right = load<Vector>(x);
    for (int r = 0; r < kRows; ++r) sum[r] += m[r * to_row] * right;
  }
  for (int r = 0; r < kRows; ++r) store(sum[r], y + r * kTogether);
}

// what the registers hold
template <class Scalar>
constexpr int kRowsTogether = sizeof(Scalar) == sizeof(float) ? 8 : 4;

template <class Scalar>
PALPATE_INLINE void multiply_any_together(const Scalar* m, int n, int columns, const Scalar* x,
                                          Scalar* y) {
  constexpr int kRows = kRowsTogether<Scalar>;
  static_assert(kPadding % kRows == 0);
  const std::ptrdiff_t ld = padded(n);
  for (std::ptrdiff_t r = 0; r < ld; r += kRows) {
    sum_together<kRows>(m + r, 1, ld, columns, x, y + r * kTogether);
  }
}

template <class Scalar>
PALPATE_INLINE void multiply_any_transposed_together(const Scalar* m, int n, int columns,
                                                     const Scalar* x, Scalar* y) {
  constexpr int kRows = kRowsTogether<Scalar>;
  const std::ptrdiff_t ld = padded(n);
  std::ptrdiff_t c = 0;
  for (; c + kRows <= columns; c += kRows) {
    sum_together<kRows>(m + c * ld, ld, 1, n, x, y + c * kTogether);
  }
  for (; c < columns; ++c) sum_together<1>(m + c * ld, ld, 1, n, x, y + c * kTogether);
}

PALPATE_CLONES void together_float(const float* m, int n, int columns, const float* x, float* y) {
  multiply_any_together(m, n, columns, x, y);
}
PALPATE_CLONES void together_double(const double* m, int n, int columns, const double* x,
                                    double* y) {
  multiply_any_together(m, n, columns, x, y);
}
PALPATE_CLONES void transposed_together_float(const float* m, int n, int columns, const float* x,
                                              float* y) {
  multiply_any_transposed_together(m, n, columns, x, y);
}
PALPATE_CLONES void transposed_together_double(const double* m, int n, int columns, const double* x,
                                               double* y) {
  multiply_any_transposed_together(m, n, columns, x, y);
}
PALPATE_CLONES void multiply_float(const float* m, int n, int columns, const float* x, float* y) {
  multiply_any(m, n, columns, x, y);
}
PALPATE_CLONES void multiply_double(const double* m, int n, int columns, const double* x,
                                    double* y) {
  multiply_any(m, n, columns, x, y);
}
PALPATE_CLONES void add_three_float(const float* m, int n, const float* x, float* y) {
  using Vector = typename VectorOf<float>::Type;
  const auto ld = static_cast<std::ptrdiff_t>(padded(n));
  for (std::ptrdiff_t r = 0; r < ld; r += kPadding) {
    store(Vector(load<Vector>(y + r) + load<Vector>(m + r) * x[0] +
                 load<Vector>(m + ld + r) * x[1] + load<Vector>(m + 2 * ld + r) * x[2]),
          y + r);
  }
}
PALPATE_CLONES void transposed_float(const float* m, int n, int columns, const float* x, float* y) {
  multiply_transposed_any(m, n, columns, x, y);
}
PALPATE_CLONES void transposed_double(const double* m, int n, int columns, const double* x,
                                      double* y) {
  multiply_transposed_any(m, n, columns, x, y);
}

}  // namespace

bool partial_cholesky(double* a, int n, int pivots) { return factor_columns(a, n, pivots); }
void invert_pivots(double* a, int n, int pivots) { invert_columns(a, n, pivots); }
void multiply(const float* m, int n, int columns, const float* x, float* y) {
  multiply_float(m, n, columns, x, y);
}
void multiply(const double* m, int n, int columns, const double* x, double* y) {
  multiply_double(m, n, columns, x, y);
}
void add_three(const float* m, int n, const float* x, float* y) { add_three_float(m, n, x, y); }
void multiply_transposed(const float* m, int n, int columns, const float* x, float* y) {
  transposed_float(m, n, columns, x, y);
}
void multiply_transposed(const double* m, int n, int columns, const double* x, double* y) {
  transposed_double(m, n, columns, x, y);
}
void multiply_together(const float* m, int n, int columns, const float* x, float* y) {
  together_float(m, n, columns, x, y);
}
void multiply_together(const double* m, int n, int columns, const double* x, double* y) {
  together_double(m, n, columns, x, y);
}
void multiply_transposed_together(const float* m, int n, int columns, const float* x, float* y) {
  transposed_together_float(m, n, columns, x, y);
}
void multiply_transposed_together(const double* m, int n, int columns, const double* x, double* y) {
  transposed_together_double(m, n, columns, x, y);
}

}  // namespace palpate::elastic
