// SPDX-License-Identifier: Apache-2.0
// dense_kernels.h — dense pieces of the sparse factorisation, for any vector width. No allocation.
#pragma once

namespace palpate::elastic {

/// Rows of dense blocks are padded to a multiple of this with zeros, and blocks begin on a multiple
/// of 64 bytes.
inline constexpr int kPadding = 16;
/// Most columns that are eliminated together.
inline constexpr int kMostPivots = 192;
[[nodiscard]] constexpr int padded(int rows) { return (rows + kPadding - 1) / kPadding * kPadding; }

/// Eliminates the first `pivots` ≤ kMostPivots columns of a symmetric n × n matrix, lower half,
/// column-major with leading dimension padded(n): they become L, the rest the Schur complement. The
/// upper half and the padding are scratch. False if a pivot is not positive.
[[nodiscard]] bool partial_cholesky(double* a, int n, int pivots);

/// [L₁₁; L₂₁] of `pivots` columns and n rows becomes [L₁₁⁻¹; L₂₁ L₁₁⁻¹], with zeros above the
/// diagonal and in the padding.
void invert_pivots(double* a, int n, int pivots);

/// y = M x, n × columns, leading dimension padded(n); y is padded(n) long.
void multiply(const float* m, int n, int columns, const float* x, float* y);
void multiply(const double* m, int n, int columns, const double* x, double* y);
/// y += M x, M has three columns.
void add_three(const float* m, int n, const float* x, float* y);
/// y = Mᵀ x, x is padded(n) long with finite numbers in the padding.
void multiply_transposed(const float* m, int n, int columns, const float* x, float* y);
void multiply_transposed(const double* m, int n, int columns, const double* x, double* y);

/// Vectors that are multiplied together, interleaved: element i of vector k at kTogether · i + k.
inline constexpr int kTogether = 16;
/// Y = M X for kTogether vectors; Y has padded(n) rows.
void multiply_together(const float* m, int n, int columns, const float* x, float* y);
void multiply_together(const double* m, int n, int columns, const double* x, double* y);
/// Y = Mᵀ X for kTogether vectors of n rows.
void multiply_transposed_together(const float* m, int n, int columns, const float* x, float* y);
void multiply_transposed_together(const double* m, int n, int columns, const double* x, double* y);

/// From now on all of these use vectors of at most so many bytes: results are the same to the bit.
/// For tests. @return  the bytes of those in use
int limit_vectors(int most_bytes);

}  // namespace palpate::elastic
