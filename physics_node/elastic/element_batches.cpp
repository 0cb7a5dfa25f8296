// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/element_batches.h"

#include <Eigen/LU>
#include <algorithm>
#include <cstring>

#include "common/contact/elastic/clones.h"
#include "physics_node/elastic/point_laws.h"

namespace palpate::elastic {
namespace {

using Lanes = double __attribute__((vector_size(sizeof(Pack))));

constexpr int kMostImprovements = 24;
// |ω|² of a step after which the rotation is exact
constexpr double kExact = 1e-12;
// Batches that are gathered, computed and scattered together: what was stored lane by lane has left
// the store buffer when it is loaded as a vector.
constexpr std::size_t kChunk = 6;

// Gauss points of the quadratic tetrahedron: Lₖ = kNear at point k, else kFar.
constexpr double kNear = 0.58541019662496845446;
constexpr double kFar = 0.13819660112501051518;

// Node between corners a and b of a quadratic element.
constexpr int kBetween[4][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}};

PALPATE_INLINE Lanes load(const Pack& pack) {
  Lanes lanes;
  std::memcpy(&lanes, pack.v, sizeof lanes);
  return lanes;
}
PALPATE_INLINE void store(const Lanes& lanes, Pack& pack) {
  std::memcpy(pack.v, &lanes, sizeof lanes);
}

template <int kNodes>
PALPATE_INLINE void gather(const std::uint32_t* nodes, const double* x, Pack* out) {
  for (int a = 0; a < kNodes; ++a) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const double* from = x + 3 * std::size_t{nodes[a * kLanes + lane]};
      out[3 * a].v[lane] = from[0];
      out[3 * a + 1].v[lane] = from[1];
      out[3 * a + 2].v[lane] = from[2];
    }
  }
}

template <int kNodes>
PALPATE_INLINE void scatter(const std::uint32_t* nodes, const Pack* in, double* gradient) {
  for (int a = 0; a < kNodes; ++a) {
    for (int lane = 0; lane < kLanes; ++lane) {
      double* to = gradient + 3 * std::size_t{nodes[a * kLanes + lane]};
      to[0] += in[3 * a].v[lane];
      to[1] += in[3 * a + 1].v[lane];
      to[2] += in[3 * a + 2].v[lane];
    }
  }
}

// F from the four y (3 components each).
PALPATE_INLINE void deformation(const Lanes* y, const Lanes* grad, Matrix3<Lanes>& F) {
  for (int i = 0; i < 3; ++i) {
    const Lanes d1 = y[3 + i] - y[i];
    const Lanes d2 = y[6 + i] - y[i];
    const Lanes d3 = y[9 + i] - y[i];
    for (int j = 0; j < 3; ++j) {
      F.a[3 * i + j] = d1 * grad[j] + d2 * grad[3 + j] + d3 * grad[6 + j];
    }
  }
}

// y of integration point `point`; shared: what the points of a quadratic element have in common.
template <int kNodes>
PALPATE_INLINE void corners_at(int point, const Pack* x, const Lanes* shared, Lanes* y) {
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < 3; ++i) {
      if constexpr (kNodes == 4) {
        y[3 * k + i] = load(x[3 * k + i]);
      } else {
        y[3 * k + i] =
            shared[3 * k + i] + 4.0 * (kNear - kFar) * load(x[3 * kBetween[k][point] + i]);
      }
    }
  }
}

template <int kNodes>
PALPATE_INLINE void shared_corners(const Pack* x, Lanes* shared) {
  if constexpr (kNodes == 10) {
    for (int k = 0; k < 4; ++k) {
      for (int i = 0; i < 3; ++i) {
        Lanes sum = (4.0 * kFar - 1.0) * load(x[3 * k + i]);
        for (int j = 0; j < 4; ++j) {
          if (j != k) sum += 4.0 * kFar * load(x[3 * kBetween[k][j] + i]);
        }
        shared[3 * k + i] = sum;
      }
    }
  }
}

PALPATE_INLINE void improve(const Matrix3<Lanes>& F, Lanes* q) {
  for (int n = 0; n < kMostImprovements; ++n) {
    const Lanes step = improve_rotation(F, q);
    bool is_exact = true;
    for (int lane = 0; lane < kLanes; ++lane) is_exact = is_exact && step[lane] < kExact;
    if (is_exact) return;
  }
}

// One batch: x (3 per node) becomes the gradient. Returns the energies of the lanes.
template <int kNodes, Law kLaw, bool kIsViscous>
PALPATE_INLINE Lanes batch_gradient(ElementBatches& elements, std::size_t b, double per_step,
                                    Pack* x) {
  constexpr int kPoints = kNodes == 4 ? 1 : 4;
  Lanes grad[9];
  for (std::size_t i = 0; i < 9; ++i) grad[i] = load(elements.gradients_per_m[9 * b + i]);
  const Lanes volume = load(elements.point_volume_m3[b]);
  const Lanes mu = load(elements.mu_pa[b]);
  const Lanes lambda = load(elements.lambda_pa[b]);
  Lanes shared[12];
  shared_corners<kNodes>(x, shared);

  Lanes energy = volume * 0.0;
  Lanes sums[12];                    // Σ over the points of ∂V/∂yₖ
  Lanes own[kNodes == 10 ? 30 : 3];  // Σ of those that belong to one node
  for (Lanes& sum : sums) sum = energy;
  for (Lanes& sum : own) sum = energy;
  Matrix3<Lanes> deformations[kPoints];
  Lanes rotations[kPoints][4];
  Lanes dilatations = energy;
  for (int point = 0; point < kPoints; ++point) {
    Lanes y[12];
    corners_at<kNodes>(point, x, shared, y);
    Matrix3<Lanes>& F = deformations[point];
    deformation(y, grad, F);
    Lanes* q = rotations[point];
    if constexpr (kLaw == Law::kCorotational) {
      const std::size_t at = 4 * (b * kPoints + static_cast<std::size_t>(point));
      for (std::size_t i = 0; i < 4; ++i) q[i] = load(elements.rotation[at + i]);
      improve(F, q);
      for (std::size_t i = 0; i < 4; ++i) store(q[i], elements.rotation[at + i]);
    }
    dilatations += dilatation<kLaw>(F, q);
  }
  const Lanes theta = (1.0 / kPoints) * dilatations;
  const Lanes pressure = lambda * theta;
  energy += 0.5 * kPoints * volume * pressure * theta;
  for (int point = 0; point < kPoints; ++point) {
    const Matrix3<Lanes>& F = deformations[point];
    Matrix3<Lanes> P;
    Lanes density = stress<kLaw>(F, mu, pressure, rotations[point], P);
    if constexpr (kIsViscous) {
      Matrix3<Lanes> F0;
      const std::size_t at = 9 * (b * kPoints + static_cast<std::size_t>(point));
      for (std::size_t i = 0; i < 9; ++i) F0.a[i] = load(elements.before[at + i]);
      const Lanes rate = per_step * load(elements.viscosity_s[b]);
      density += add_viscous_stress(F, F0, mu, lambda, rate, P);
    }
    energy += volume * density;
    for (int i = 0; i < 3; ++i) {
      Lanes h[4];
      for (int k = 1; k < 4; ++k) {
        const Lanes* g = grad + 3 * (k - 1);
        h[k] = volume * (P.a[3 * i] * g[0] + P.a[3 * i + 1] * g[1] + P.a[3 * i + 2] * g[2]);
      }
      h[0] = -(h[1] + h[2] + h[3]);
      for (int k = 0; k < 4; ++k) {
        sums[3 * k + i] += h[k];
        if constexpr (kNodes == 10) own[3 * kBetween[k][point] + i] += h[k];
      }
    }
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 4; ++k) {
      if constexpr (kNodes == 4) {
        store(sums[3 * k + i], x[3 * k + i]);
      } else {
        store((4.0 * kFar - 1.0) * sums[3 * k + i] + 4.0 * (kNear - kFar) * own[3 * k + i],
              x[3 * k + i]);
        for (int j = k + 1; j < 4; ++j) {
          const int node = 3 * kBetween[k][j] + i;
          store(4.0 * kFar * (sums[3 * k + i] + sums[3 * j + i]) + 4.0 * (kNear - kFar) * own[node],
                x[node]);
        }
      }
    }
  }
  return energy;
}

template <int kNodes, Law kLaw, bool kIsViscous>
PALPATE_INLINE double all_gradients(ElementBatches& elements, const double* x, double per_step,
                                    double* gradient) {
  Pack buffer[kChunk * 3 * kNodes];
  Lanes energy = load(elements.point_volume_m3[0]) * 0.0;
  for (std::size_t first = 0; first < elements.batches; first += kChunk) {
    const std::size_t end = std::min(first + kChunk, elements.batches);
    const std::uint32_t* nodes = elements.nodes.data() + first * kNodes * kLanes;
    for (std::size_t b = first; b < end; ++b) {
      gather<kNodes>(nodes + (b - first) * kNodes * kLanes, x, buffer + (b - first) * 3 * kNodes);
    }
    for (std::size_t b = first; b < end; ++b) {
      energy += batch_gradient<kNodes, kLaw, kIsViscous>(elements, b, per_step,
                                                         buffer + (b - first) * 3 * kNodes);
    }
    for (std::size_t b = first; b < end; ++b) {
      scatter<kNodes>(nodes + (b - first) * kNodes * kLanes, buffer + (b - first) * 3 * kNodes,
                      gradient);
    }
  }
  double sum = 0.0;
  for (int lane = 0; lane < kLanes; ++lane) sum += energy[lane];
  return sum;
}

template <int kNodes, bool kIsViscous>
PALPATE_INLINE double gradients_of_law(ElementBatches& elements, const double* x, double per_step,
                                       double* gradient) {
  switch (elements.law) {
    case Law::kCorotational:
      return all_gradients<kNodes, Law::kCorotational, kIsViscous>(elements, x, per_step, gradient);
    case Law::kStVenantKirchhoff:
      return all_gradients<kNodes, Law::kStVenantKirchhoff, kIsViscous>(elements, x, per_step,
                                                                        gradient);
    case Law::kStableNeoHookean:
      break;
  }
  return all_gradients<kNodes, Law::kStableNeoHookean, kIsViscous>(elements, x, per_step, gradient);
}

PALPATE_CLONES double linear_gradients(ElementBatches& elements, const double* x,
                                       double* gradient) {
  return gradients_of_law<4, false>(elements, x, 0.0, gradient);
}
PALPATE_CLONES double quadratic_gradients(ElementBatches& elements, const double* x,
                                          double* gradient) {
  return gradients_of_law<10, false>(elements, x, 0.0, gradient);
}
PALPATE_CLONES double viscous_linear_gradients(ElementBatches& elements, const double* x,
                                               double per_step, double* gradient) {
  return gradients_of_law<4, true>(elements, x, per_step, gradient);
}
PALPATE_CLONES double viscous_quadratic_gradients(ElementBatches& elements, const double* x,
                                                  double per_step, double* gradient) {
  return gradients_of_law<10, true>(elements, x, per_step, gradient);
}

template <int kNodes>
PALPATE_INLINE void remember_all(ElementBatches& elements, const double* x) {
  constexpr std::size_t kPoints = kNodes == 4 ? 1 : 4;
  Pack buffer[3 * kNodes];
  for (std::size_t b = 0; b < elements.batches; ++b) {
    gather<kNodes>(elements.nodes.data() + b * kNodes * kLanes, x, buffer);
    Lanes grad[9];
    for (std::size_t i = 0; i < 9; ++i) grad[i] = load(elements.gradients_per_m[9 * b + i]);
    Lanes shared[12];
    shared_corners<kNodes>(buffer, shared);
    for (std::size_t point = 0; point < kPoints; ++point) {
      Lanes y[12];
      corners_at<kNodes>(static_cast<int>(point), buffer, shared, y);
      Matrix3<Lanes> F;
      deformation(y, grad, F);
      for (std::size_t i = 0; i < 9; ++i) {
        store(F.a[i], elements.before[9 * (b * kPoints + point) + i]);
      }
    }
  }
}

template <int kNodes>
PALPATE_INLINE void rotate_all(ElementBatches& elements, const double* x) {
  Pack buffer[3 * kNodes];
  for (std::size_t b = 0; b < elements.batches; ++b) {
    gather<kNodes>(elements.nodes.data() + b * kNodes * kLanes, x, buffer);
    Lanes grad[9];
    for (std::size_t i = 0; i < 9; ++i) grad[i] = load(elements.gradients_per_m[9 * b + i]);
    Lanes y[12];
    for (int k = 0; k < 4; ++k) {
      for (int i = 0; i < 3; ++i) {
        if constexpr (kNodes == 4) {
          y[3 * k + i] = load(buffer[3 * k + i]);
        } else {
          Lanes sum = grad[0] * 0.0;
          for (int j = 0; j < 4; ++j) {
            if (j != k) sum += load(buffer[3 * kBetween[k][j] + i]);
          }
          y[3 * k + i] = sum;
        }
      }
    }
    Matrix3<Lanes> F;
    deformation(y, grad, F);
    Lanes q[4];
    for (std::size_t i = 0; i < 4; ++i) q[i] = load(elements.middle_rotation[4 * b + i]);
    improve(F, q);
    for (std::size_t i = 0; i < 4; ++i) store(q[i], elements.middle_rotation[4 * b + i]);
  }
}

PALPATE_CLONES void remember_linear(ElementBatches& elements, const double* x) {
  remember_all<4>(elements, x);
}
PALPATE_CLONES void remember_quadratic(ElementBatches& elements, const double* x) {
  remember_all<10>(elements, x);
}
PALPATE_CLONES void rotate_linear(ElementBatches& elements, const double* x) {
  rotate_all<4>(elements, x);
}
PALPATE_CLONES void rotate_quadratic(ElementBatches& elements, const double* x) {
  rotate_all<10>(elements, x);
}

std::vector<Pack> identity_quaternions(std::size_t count) {
  std::vector<Pack> packs(4 * count, Pack{});
  for (std::size_t i = 0; i < packs.size(); i += 4) {
    for (double& w : packs[i].v) w = 1.0;
  }
  return packs;
}

}  // namespace

ElementBatches batches_of(const Mesh& mesh, const std::vector<Material>& materials, Law law) {
  ElementBatches elements;
  elements.nodes_per_element = mesh.nodes_per_element;
  elements.points = mesh.nodes_per_element == 4 ? 1 : 4;
  elements.law = law;
  const std::size_t count = mesh.element_count();
  elements.batches = (count + kLanes - 1) / kLanes;
  const auto per = static_cast<std::size_t>(mesh.nodes_per_element);
  elements.nodes.resize(elements.batches * per * kLanes);
  elements.gradients_per_m.resize(elements.batches * 9);
  elements.point_volume_m3.resize(elements.batches);
  elements.mu_pa.resize(elements.batches);
  elements.lambda_pa.resize(elements.batches);
  elements.viscosity_s.resize(elements.batches);
  bool is_viscous = false;
  for (std::size_t i = 0; i < elements.batches * kLanes; ++i) {
    const std::size_t b = i / kLanes;
    const std::size_t lane = i % kLanes;
    const std::size_t e = std::min(i, count - 1);  // the last one fills up the last batch
    const auto t = mesh.element(e);
    for (std::size_t a = 0; a < per; ++a) elements.nodes[(b * per + a) * kLanes + lane] = t[a];
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) = mesh.nodes_m[t[static_cast<std::size_t>(k + 1)]] - mesh.nodes_m[t[0]];
    }
    const Eigen::Matrix3d gradients = edges.inverse();
    for (int k = 0; k < 9; ++k) {
      elements.gradients_per_m[9 * b + static_cast<std::size_t>(k)].v[lane] =
          gradients(k / 3, k % 3);
    }
    const Material& material = materials[mesh.regions.empty() ? 0 : mesh.regions[e]];
    elements.point_volume_m3[b].v[lane] =
        i < count ? edges.determinant() / 6.0 / elements.points : 0.0;
    elements.mu_pa[b].v[lane] = material.mu();
    elements.lambda_pa[b].v[lane] = material.lambda();
    elements.viscosity_s[b].v[lane] = material.stiffness_damping_s;
    is_viscous = is_viscous || material.stiffness_damping_s > 0.0;
  }
  const std::size_t points = elements.batches * static_cast<std::size_t>(elements.points);
  if (law == Law::kCorotational) elements.rotation = identity_quaternions(points);
  if (law != Law::kCorotational || per == 10) {
    elements.middle_rotation = identity_quaternions(elements.batches);
  }
  if (is_viscous) {
    elements.before.resize(9 * points);
  } else {
    elements.viscosity_s.clear();
  }
  return elements;
}

double add_gradient(ElementBatches& batches, const double* x_m, double step_s, double* gradient) {
  if (batches.batches == 0) return 0.0;
  if (step_s > 0.0 && !batches.viscosity_s.empty()) {
    return batches.nodes_per_element == 4
               ? viscous_linear_gradients(batches, x_m, 1.0 / step_s, gradient)
               : viscous_quadratic_gradients(batches, x_m, 1.0 / step_s, gradient);
  }
  return batches.nodes_per_element == 4 ? linear_gradients(batches, x_m, gradient)
                                        : quadratic_gradients(batches, x_m, gradient);
}

void remember(ElementBatches& batches, const double* x_m) {
  if (batches.before.empty()) return;
  if (batches.nodes_per_element == 4) {
    remember_linear(batches, x_m);
  } else {
    remember_quadratic(batches, x_m);
  }
}

const Pack* update_rotations(ElementBatches& batches, const double* x_m) {
  if (batches.middle_rotation.empty()) return batches.rotation.data();
  if (batches.nodes_per_element == 4) {
    rotate_linear(batches, x_m);
  } else {
    rotate_quadratic(batches, x_m);
  }
  return batches.middle_rotation.data();
}

}  // namespace palpate::elastic
