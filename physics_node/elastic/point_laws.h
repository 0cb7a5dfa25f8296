// SPDX-License-Identifier: Apache-2.0
// point_laws.h — stress and energy density at one point, or at several in the lanes of a vector.
//
// T is double or a vector of doubles. Matrices are row-major arrays of 9. No branch depends on the
// values, so that every lane computes the same and results do not depend on the instruction set.
#pragma once

#include "physics_node/elastic/material.h"

// The callers are compiled for several instruction sets: what they call has to become part of them.
#define PALPATE_INLINE [[gnu::always_inline]] inline

namespace palpate::elastic {

template <class T>
struct Matrix3 {
  T a[9];  // NOLINT: lanes in registers
};

/// AᵀB
template <class T>
PALPATE_INLINE void transposed_times(const Matrix3<T>& A, const Matrix3<T>& B, Matrix3<T>& C) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      C.a[3 * i + j] = A.a[i] * B.a[j] + A.a[3 + i] * B.a[3 + j] + A.a[6 + i] * B.a[6 + j];
    }
  }
}

/// A B
template <class T>
PALPATE_INLINE void times(const Matrix3<T>& A, const Matrix3<T>& B, Matrix3<T>& C) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      C.a[3 * i + j] =
          A.a[3 * i] * B.a[j] + A.a[3 * i + 1] * B.a[3 + j] + A.a[3 * i + 2] * B.a[6 + j];
    }
  }
}

/// ∂ det A / ∂A
template <class T>
PALPATE_INLINE void cofactors(const Matrix3<T>& A, Matrix3<T>& C) {
  const T* a = A.a;
  C.a[0] = a[4] * a[8] - a[5] * a[7];
  C.a[1] = a[5] * a[6] - a[3] * a[8];
  C.a[2] = a[3] * a[7] - a[4] * a[6];
  C.a[3] = a[2] * a[7] - a[1] * a[8];
  C.a[4] = a[0] * a[8] - a[2] * a[6];
  C.a[5] = a[1] * a[6] - a[0] * a[7];
  C.a[6] = a[1] * a[5] - a[2] * a[4];
  C.a[7] = a[2] * a[3] - a[0] * a[5];
  C.a[8] = a[0] * a[4] - a[1] * a[3];
}

/// The rotation of a quaternion w, x, y, z of any length but 0.
template <class T>
PALPATE_INLINE void rotation_of(const T* q, Matrix3<T>& R) {
  const T s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const T xs = q[1] * s;
  const T ys = q[2] * s;
  const T zs = q[3] * s;
  const T wx = q[0] * xs;
  const T wy = q[0] * ys;
  const T wz = q[0] * zs;
  const T xx = q[1] * xs;
  const T xy = q[1] * ys;
  const T xz = q[1] * zs;
  const T yy = q[2] * ys;
  const T yz = q[2] * zs;
  const T zz = q[3] * zs;
  R.a[0] = 1.0 - (yy + zz);
  R.a[1] = xy - wz;
  R.a[2] = xz + wy;
  R.a[3] = xy + wz;
  R.a[4] = 1.0 - (xx + zz);
  R.a[5] = yz - wx;
  R.a[6] = xz - wy;
  R.a[7] = yz + wx;
  R.a[8] = 1.0 - (xx + yy);
}

/// One Newton step of the quaternion q towards the rotation R that maximises tr(RᵀF), the rotation
/// of F's polar decomposition: ω = (tr(B) I − sym B)⁻¹ axial(B − Bᵀ), B = RᵀF [Kugelstadt18].
/// Where the matrix is not positive definite (F near inversion) a step along the gradient.
/// Returns |ω|² of the step: a Newton step leaves an error of the order of |ω|³.
template <class T>
PALPATE_INLINE T improve_rotation(const Matrix3<T>& F, T* q) {
  Matrix3<T> R;
  Matrix3<T> B;
  rotation_of(q, R);
  transposed_times(R, F, B);
  const T* b = B.a;
  const T g[3] = {b[7] - b[5], b[2] - b[6], b[3] - b[1]};
  // H = tr(B) I − sym B
  const T h00 = b[4] + b[8];
  const T h11 = b[0] + b[8];
  const T h22 = b[0] + b[4];
  const T h01 = -0.5 * (b[1] + b[3]);
  const T h02 = -0.5 * (b[2] + b[6]);
  const T h12 = -0.5 * (b[5] + b[7]);
  const T c00 = h11 * h22 - h12 * h12;
  const T c01 = h02 * h12 - h01 * h22;
  const T c02 = h01 * h12 - h02 * h11;
  const T c11 = h00 * h22 - h02 * h02;
  const T c12 = h01 * h02 - h00 * h12;
  const T c22 = h00 * h11 - h01 * h01;
  const T det = h00 * c00 + h01 * c01 + h02 * c02;
  const T trace = h00 + h11 + h22;
  T size = 1e-30 + F.a[0] * F.a[0];
  for (int i = 1; i < 9; ++i) size += F.a[i] * F.a[i];
  const auto is_good = (det > 1e-9 * size * trace) & (trace > 0.0) & (c00 + c11 + c22 > 0.0);
  const T one = size * 0.0 + 1.0;
  const T inverse = one / (is_good ? det : one);
  const T along = one / (one + size);
  T w[3] = {
      is_good ? (c00 * g[0] + c01 * g[1] + c02 * g[2]) * inverse : g[0] * along,
      is_good ? (c01 * g[0] + c11 * g[1] + c12 * g[2]) * inverse : g[1] * along,
      is_good ? (c02 * g[0] + c12 * g[1] + c22 * g[2]) * inverse : g[2] * along,
  };
  const T step = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  // at most half a turn's tangent, to first order the step itself
  const T damp = 0.5 / (1.0 + 0.25 * step);
  for (T& component : w) component = component * damp;
  const T p[4] = {q[0] - (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
                  q[1] + (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
                  q[2] + (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
                  q[3] + (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])};
  // the length stays near 1; rotation_of divides by what is left of it
  const T length2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3];
  const T scale = 1.5 - 0.5 * length2;
  const auto is_near = (scale > 0.5) & (scale < 1.5);
  const T norm = is_near ? scale : one / length2;
  for (int i = 0; i < 4; ++i) q[i] = p[i] * norm;
  return step;
}

/// The energy density of every law is a part that does not depend on λ plus ½ λ θ² with the
/// dilatation θ = tr S − 3 (corotational), tr E (St. Venant–Kirchhoff) or J − 1 (neo-Hookean).
/// Quadratic elements take for θ the mean of the element, so that they do not lock near ν = ½.

/// θ of F. For the corotational law `q` is the rotation of F.
template <Law kLaw, class T>
PALPATE_INLINE T dilatation(const Matrix3<T>& F, const T* q) {
  if constexpr (kLaw == Law::kCorotational) {
    Matrix3<T> R;
    rotation_of(q, R);
    T trace = F.a[0] * R.a[0] - 3.0;
    for (int i = 1; i < 9; ++i) trace += F.a[i] * R.a[i];
    return trace;
  } else if constexpr (kLaw == Law::kStVenantKirchhoff) {
    T norm2 = F.a[0] * F.a[0] - 3.0;
    for (int i = 1; i < 9; ++i) norm2 += F.a[i] * F.a[i];
    return 0.5 * norm2;
  } else {
    Matrix3<T> C;
    cofactors(F, C);
    return F.a[0] * C.a[0] + F.a[1] * C.a[1] + F.a[2] * C.a[2] - 1.0;
  }
}

/// First Piola-Kirchhoff stress P of F under the pressure λ θ, and the energy density without its
/// part ½ λ θ². `q` as above.
template <Law kLaw, class T>
PALPATE_INLINE T stress(const Matrix3<T>& F, const T& mu, const T& pressure, const T* q,
                        Matrix3<T>& P) {
  if constexpr (kLaw == Law::kCorotational) {
    Matrix3<T> R;
    rotation_of(q, R);
    T norm2 = mu * 0.0;
    for (int i = 0; i < 9; ++i) {
      const T stretch = F.a[i] - R.a[i];
      norm2 += stretch * stretch;
      P.a[i] = 2.0 * mu * stretch + pressure * R.a[i];
    }
    return mu * norm2;
  } else if constexpr (kLaw == Law::kStVenantKirchhoff) {
    Matrix3<T> E;
    transposed_times(F, F, E);
    for (int i = 0; i < 9; ++i) E.a[i] = 0.5 * (E.a[i] - (i % 4 == 0 ? 1.0 : 0.0));
    T norm2 = E.a[0] * E.a[0];
    for (int i = 1; i < 9; ++i) norm2 += E.a[i] * E.a[i];
    Matrix3<T> S;
    for (int i = 0; i < 9; ++i) S.a[i] = 2.0 * mu * E.a[i];
    for (int i = 0; i < 9; i += 4) S.a[i] += pressure;
    times(F, S, P);
    return mu * norm2;
  } else {
    Matrix3<T> C;
    cofactors(F, C);
    const T volume = F.a[0] * C.a[0] + F.a[1] * C.a[1] + F.a[2] * C.a[2] - 1.0;
    T norm2 = F.a[0] * F.a[0] - 3.0;
    for (int i = 1; i < 9; ++i) norm2 += F.a[i] * F.a[i];
    const T sum = pressure + mu * (volume - 1.0);
    for (int i = 0; i < 9; ++i) P.a[i] = mu * F.a[i] + sum * C.a[i];
    return mu * (0.5 * norm2 - volume + 0.5 * volume * volume);
  }
}

/// Adds the stress of the viscous potential (β/2h) (2µ |D|² + λ tr²D), D = sym(F₀ᵀ (F − F₀)), for a
/// step of length h from F₀: β C Ė with Ė = D / h. Returns the potential. `rate` = β / h.
template <class T>
PALPATE_INLINE T add_viscous_stress(const Matrix3<T>& F, const Matrix3<T>& F0, const T& mu,
                                    const T& lambda, const T& rate, Matrix3<T>& P) {
  Matrix3<T> change;
  Matrix3<T> B;
  for (int i = 0; i < 9; ++i) change.a[i] = F.a[i] - F0.a[i];
  transposed_times(F0, change, B);
  Matrix3<T> S;
  T norm2 = mu * 0.0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const T d = 0.5 * (B.a[3 * i + j] + B.a[3 * j + i]);
      norm2 += d * d;
      S.a[3 * i + j] = 2.0 * mu * rate * d;
    }
  }
  const T trace = B.a[0] + B.a[4] + B.a[8];
  for (int i = 0; i < 9; i += 4) S.a[i] += lambda * rate * trace;
  Matrix3<T> more;
  times(F0, S, more);
  for (int i = 0; i < 9; ++i) P.a[i] += more.a[i];
  return rate * (mu * norm2 + 0.5 * lambda * trace * trace);
}

}  // namespace palpate::elastic
