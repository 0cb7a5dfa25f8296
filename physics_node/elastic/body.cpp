// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/body.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "physics_node/elastic/point_laws.h"
#include "physics_node/elastic/point_tangent.h"
#include "physics_node/elastic/warped_factor.h"

namespace palpate::elastic {
namespace {

using Eigen::Matrix3d;

// Of the blocks in the factor of a body, those in that of another one with the same order.
constexpr double kMostFill = 1.2;

void require(bool is_so, const std::string& rule) {
  if (!is_so) throw std::invalid_argument("elastic body: " + rule);
}

void check(const BodyDescription& body) {
  const Mesh& mesh = body.mesh;
  require(mesh.nodes_per_element == 4 || mesh.nodes_per_element == 10,
          "elements have 4 or 10 nodes");
  require(!mesh.elements.empty() &&
              mesh.elements.size() % static_cast<std::size_t>(mesh.nodes_per_element) == 0,
          "the list of elements must not be empty or end within an element");
  const std::size_t nodes = mesh.nodes_m.size();
  require(std::all_of(mesh.elements.begin(), mesh.elements.end(),
                      [&](std::uint32_t node) { return node < nodes; }),
          "an element names a node that does not exist");
  require(std::all_of(mesh.nodes_m.begin(), mesh.nodes_m.end(),
                      [](const Vector3d& node) { return node.allFinite(); }),
          "a node has a coordinate that is not finite");
  require(mesh.regions.empty() || mesh.regions.size() == mesh.element_count(),
          "regions must be given for all elements or for none");
  require(!body.materials.empty() &&
              std::all_of(mesh.regions.begin(), mesh.regions.end(),
                          [&](std::uint8_t region) { return region < body.materials.size(); }),
          "every region needs a material");
  for (const Material& material : body.materials) {
    require(material.young_modulus_pa > 0.0 && std::isfinite(material.young_modulus_pa),
            "young_modulus_pa must be above 0");
    require(material.poisson_ratio > -1.0 && material.poisson_ratio < 0.5,
            "poisson_ratio must be above -1 and below 0.5");
    require(material.density_kg_per_m3 > 0.0 && std::isfinite(material.density_kg_per_m3),
            "density_kg_per_m3 must be above 0");
    require(material.mass_damping_per_s >= 0.0 && material.stiffness_damping_s >= 0.0,
            "damping must not be below 0");
  }
  require(body.branches.size() <= kMostBranches, "at most 8 branches");
  double shares = 0.0;
  for (const Branch& branch : body.branches) {
    shares += branch.share;
    require(branch.share > 0.0 && branch.tau_s > 0.0 && std::isfinite(branch.tau_s),
            "share and tau_s of a branch must be above 0");
  }
  require(shares < 1.0, "the shares of the branches must sum to less than 1");
  const MeshQuality quality = quality_of(mesh);
  require(quality.inverted == 0, std::to_string(quality.inverted) +
                                     " elements are inverted or flat, the worst is number " +
                                     std::to_string(quality.worst_element));
  require(quality.unused_nodes == 0,
          std::to_string(quality.unused_nodes) + " nodes belong to no element");
  require(!body.fixed_nodes.empty() || !body.attachments.empty(),
          "at least one node must be fixed or attached");
  require(std::all_of(body.attachments.begin(), body.attachments.end(),
                      [&](const Attachment& one) {
                        return one.node < nodes && one.stiffness_newton_per_m > 0.0 &&
                               std::isfinite(one.stiffness_newton_per_m);
                      }),
          "an attached node does not exist, or its stiffness is not above 0");
  require(std::all_of(body.fixed_nodes.begin(), body.fixed_nodes.end(),
                      [&](std::uint32_t node) { return node < nodes; }),
          "a fixed node does not exist");
  require(body.more_load_newton.size() == 0 ||
              (body.more_load_newton.size() == 3 * static_cast<Eigen::Index>(nodes) &&
               body.more_load_newton.allFinite()),
          "more_load_newton must be 3 finite numbers for each node");
}

// ∂yₖ/∂xₐ of a quadratic element's point: the rest of the chain is F = Σ yₖ ⊗ ∇Lₖ.
Eigen::Matrix<double, 10, 4> chain_at(std::size_t point) {
  constexpr double kNear = 0.58541019662496845446;
  constexpr double kFar = 0.13819660112501051518;
  const auto at = [&](std::size_t k) { return k == point ? kNear : kFar; };
  Eigen::Matrix<double, 10, 4> chain = Eigen::Matrix<double, 10, 4>::Zero();
  for (std::size_t k = 0; k < 4; ++k) {
    chain(static_cast<int>(k), static_cast<int>(k)) = 4.0 * at(k) - 1.0;
  }
  for (std::size_t edge = 0; edge < 6; ++edge) {
    const auto row = static_cast<int>(4 + edge);
    chain(row, kEdges[edge][0]) = 4.0 * at(static_cast<std::size_t>(kEdges[edge][1]));
    chain(row, kEdges[edge][1]) = 4.0 * at(static_cast<std::size_t>(kEdges[edge][0]));
  }
  return chain;
}

// Calls add(a, b, block) for the nodes a, b of an element whose block is stored.
template <class Add>
void for_blocks(const BlockPattern& pattern, std::span<const std::uint32_t> nodes,
                BlockValues& values, Add add) {
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    const std::int32_t i = pattern.row_of[nodes[a]];
    if (i < 0) continue;
    for (std::size_t b = 0; b < nodes.size(); ++b) {
      const std::int32_t j = pattern.row_of[nodes[b]];
      if (j < 0 || j > i) continue;
      add(a, b,
          values.data() + 9 * std::size_t{pattern.slot(static_cast<std::uint32_t>(i),
                                                       static_cast<std::uint32_t>(j))});
    }
  }
}

double dilatation(Law law, const Matrix3<double>& F, const double* q) {
  switch (law) {
    case Law::kCorotational:
      return dilatation<Law::kCorotational>(F, q);
    case Law::kStVenantKirchhoff:
      return dilatation<Law::kStVenantKirchhoff>(F, q);
    case Law::kStableNeoHookean:
      break;
  }
  return dilatation<Law::kStableNeoHookean>(F, q);
}

}  // namespace

Body::Body(BodyDescription description, const Body* before,
           std::span<const std::uint32_t> old_nodes)
    : description_(std::move(description)), shared_factors_(std::make_shared<SharedFactors>()) {
  check(description_);
  const Mesh& mesh = description_.mesh;
  std::vector<bool> is_fixed(mesh.nodes_m.size(), false);
  for (const std::uint32_t node : description_.fixed_nodes) is_fixed[node] = true;
  pattern_ = pattern_of(mesh, is_fixed);
  if (before != nullptr) analyse_as(*before, old_nodes);
  if (symbolic_ == nullptr) {
    SymbolicFactor dissected = analyse(pattern_, dissection_order(pattern_, mesh.nodes_m));
    SymbolicFactor least_degree = analyse(pattern_, minimum_degree_order(pattern_));
    symbolic_ = std::make_shared<const SymbolicFactor>(
        dissected.stored_blocks < least_degree.stored_blocks ? std::move(dissected)
                                                             : std::move(least_degree));
  }

  const auto nodes = static_cast<Eigen::Index>(mesh.nodes_m.size());
  rest_m_.resize(3 * nodes);
  for (Eigen::Index i = 0; i < nodes; ++i) {
    rest_m_.segment<3>(3 * i) = mesh.nodes_m[static_cast<std::size_t>(i)];
  }
  mass_kg_ = VectorXd::Zero(nodes);
  mass_damping_ = VectorXd::Zero(nodes);
  const bool has_gravity = !description_.gravity_m_per_s2.isZero(0.0);
  load_ = description_.more_load_newton;
  if (has_gravity && load_.size() == 0) load_ = VectorXd::Zero(3 * nodes);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto t = mesh.element(e);
    const Material& material = description_.materials[mesh.regions.empty() ? 0 : mesh.regions[e]];
    Matrix3d edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) = mesh.nodes_m[t[static_cast<std::size_t>(k) + 1]] - mesh.nodes_m[t[0]];
    }
    const double mass = edges.determinant() / 6.0 * material.density_kg_per_m3;
    for (std::size_t a = 0; a < t.size(); ++a) {
      const bool is_corner = a < 4;
      const bool is_linear = t.size() == 4;
      const double share = is_linear ? 0.25 : is_corner ? 1.0 / 36.0 : 4.0 / 27.0;
      const double weight = is_linear ? 0.25 : is_corner ? -1.0 / 20.0 : 1.0 / 5.0;
      mass_kg_[t[a]] += share * mass;
      mass_damping_[t[a]] += share * mass * material.mass_damping_per_s;
      if (has_gravity) {
        load_.segment<3>(3 * Eigen::Index{t[a]}) += weight * mass * description_.gravity_m_per_s2;
      }
    }
  }
  for (const Material& material : description_.materials) {
    is_viscous_ = is_viscous_ || material.stiffness_damping_s > 0.0;
    has_mass_damping_ = has_mass_damping_ || material.mass_damping_per_s > 0.0;
  }
}

/// Each node when that one is eliminated, copies one after the other.
void Body::analyse_as(const Body& before, std::span<const std::uint32_t> old_nodes) {
  if (pattern_.row_of == before.pattern_.row_of && pattern_.starts == before.pattern_.starts &&
      pattern_.rows == before.pattern_.rows) {
    symbolic_ = before.symbolic_;
    return;
  }
  if (old_nodes.empty()) return;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> places;
  for (std::uint32_t row = 0; row < pattern_.size(); ++row) {
    const std::int32_t old = before.pattern_.row_of[old_nodes[pattern_.nodes[row]]];
    if (old < 0) return;
    places.emplace_back(before.symbolic_->position[static_cast<std::size_t>(old)], row);
  }
  std::sort(places.begin(), places.end());
  std::vector<std::uint32_t> order;
  for (const auto& [place, row] : places) order.push_back(row);
  SymbolicFactor symbolic = analyse(pattern_, std::move(order));
  const auto most = kMostFill * static_cast<double>(before.symbolic_->stored_blocks);
  if (static_cast<double>(symbolic.stored_blocks) > most) return;
  symbolic_ = std::make_shared<const SymbolicFactor>(std::move(symbolic));
}

bool Body::has_inverted_element(const VectorXd& x_m) const {
  for (std::size_t e = 0; e < mesh().element_count(); ++e) {
    const auto t = mesh().element(e);
    Matrix3d edges;
    for (Eigen::Index k = 0; k < 3; ++k) {
      edges.col(k) = x_m.segment<3>(3 * Eigen::Index{t[static_cast<std::size_t>(k + 1)]}) -
                     x_m.segment<3>(3 * Eigen::Index{t[0]});
    }
    if (!(edges.determinant() > 0.0)) return true;
  }
  return false;
}

double Body::add_attachments(const double* x_m, const double* before_m, double step_s,
                             double* gradient) const noexcept {
  const double viscosity_s = description_.materials.front().stiffness_damping_s;
  const double viscous_rate = step_s > 0.0 ? viscosity_s / step_s : 0.0;
  double energy = 0.0;
  for (const Attachment& one : description_.attachments) {
    const double rate = one.is_tie() ? 0.0 : viscous_rate;
    const Eigen::Index first = 3 * Eigen::Index{one.node};
    for (Eigen::Index k = first; k < first + 3; ++k) {
      const double away = x_m[k] - rest_m_[k];
      const double way = rate > 0.0 ? x_m[k] - before_m[k] : 0.0;
      energy += 0.5 * one.stiffness_newton_per_m * (away * away + rate * way * way);
      gradient[k] += one.stiffness_newton_per_m * (away + rate * way);
    }
  }
  return energy;
}

void Body::stiffness(const VectorXd& x_m, const std::vector<double>& rotations, const Shift& shift,
                     bool is_projected, BlockValues& values) const {
  const Mesh& mesh = description_.mesh;
  values.assign(9 * pattern_.rows.size(), 0.0);
  const bool is_linear = mesh.nodes_per_element == 4;
  const std::size_t points = is_linear ? 1 : 4;
  std::array<Eigen::Matrix<double, 10, 4>, 4> chains;
  for (std::size_t point = 0; point < points; ++point) chains[point] = chain_at(point);

  using Gradients = Eigen::Matrix<double, 10, 3>;
  std::array<Gradients, 4> gradients;
  std::array<Matrix3d, 4> deformations;
  std::array<std::array<double, 4>, 4> quaternions{};
  std::array<Eigen::Matrix<double, 9, 3>, 10> forces;  // ∂P/∂x of each node
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto t = mesh.element(e);
    const Material& material = description_.materials[mesh.regions.empty() ? 0 : mesh.regions[e]];
    const double stiffening = 1.0 + shift.stiffening;
    const double mu = stiffening * material.mu();
    const double lambda = stiffening * material.lambda();
    const double rate = shift.per_viscosity * material.stiffness_damping_s / stiffening;
    Matrix3d edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) = mesh.nodes_m[t[static_cast<std::size_t>(k) + 1]] - mesh.nodes_m[t[0]];
    }
    const double volume = edges.determinant() / 6.0 / static_cast<double>(points);
    Eigen::Matrix<double, 4, 3> barycentric;
    barycentric.bottomRows<3>() = edges.inverse();
    barycentric.row(0) = -barycentric.bottomRows<3>().colwise().sum();
    // the change of volume is that of the whole element
    double dilatation_sum = 0.0;
    for (std::size_t point = 0; point < points; ++point) {
      Gradients& g = gradients[point];
      g.setZero();
      if (is_linear) {
        g.topRows<4>() = barycentric;
      } else {
        g = chains[point] * barycentric;
      }
      Matrix3d& F = deformations[point];
      F.setZero();
      for (std::size_t a = 0; a < t.size(); ++a) {
        F += x_m.segment<3>(3 * Eigen::Index{t[a]}) * g.row(static_cast<Eigen::Index>(a));
      }
      Matrix3<double> f;
      for (int i = 0; i < 9; ++i) f.a[i] = F(i / 3, i % 3);
      double* q = quaternions[point].data();
      if (description_.law == Law::kCorotational) {
        std::copy_n(rotations.begin() + 4 * std::ptrdiff_t{t[0]}, 4, q);
        for (int n = 0; n < 40 && improve_rotation(f, q) > 1e-14; ++n) {
        }
      }
      dilatation_sum += dilatation(description_.law, f, q);
    }
    const double pressure = lambda * dilatation_sum / static_cast<double>(points);
    Eigen::Matrix<double, 3, 10> dilatation_gradient = Eigen::Matrix<double, 3, 10>::Zero();
    for (std::size_t point = 0; point < points; ++point) {
      const Gradients& g = gradients[point];
      PointTangent at =
          tangent(description_.law, deformations[point], mu, pressure, quaternions[point].data());
      if (rate > 0.0) at.stiffness += viscous_tangent(deformations[point], mu, lambda, rate);
      if (is_linear) {
        at.stiffness += lambda * at.dilatation * at.dilatation.transpose();
      } else {
        for (std::size_t a = 0; a < t.size(); ++a) {
          const auto column = static_cast<Eigen::Index>(a);
          for (int i = 0; i < 3; ++i) {
            dilatation_gradient(i, column) +=
                g.row(column).dot(at.dilatation.segment<3>(3 * Eigen::Index{i})) * volume;
          }
        }
      }
      if (is_projected) make_semidefinite(at.stiffness);
      for (std::size_t a = 0; a < t.size(); ++a) {
        for (int k = 0; k < 3; ++k) {
          forces[a].col(k) = at.stiffness.middleCols<3>(3 * Eigen::Index{k}) *
                             g.row(static_cast<Eigen::Index>(a)).transpose() * volume;
        }
      }
      for_blocks(pattern_, t, values, [&](std::size_t a, std::size_t b, double* block) {
        const auto row = g.row(static_cast<Eigen::Index>(a));
        for (Eigen::Index r = 0; r < 3; ++r) {
          for (Eigen::Index k = 0; k < 3; ++k) {
            block[3 * r + k] += row[0] * forces[b](3 * r, k) + row[1] * forces[b](3 * r + 1, k) +
                                row[2] * forces[b](3 * r + 2, k);
          }
        }
      });
    }
    if (is_linear) continue;
    const double per_volume = lambda / (volume * static_cast<double>(points));
    for_blocks(pattern_, t, values, [&](std::size_t a, std::size_t b, double* block) {
      const auto i = static_cast<Eigen::Index>(a);
      const auto j = static_cast<Eigen::Index>(b);
      for (int r = 0; r < 3; ++r) {
        for (int k = 0; k < 3; ++k)
          block[3 * r + k] += per_volume * dilatation_gradient(r, i) * dilatation_gradient(k, j);
      }
    });
  }
  for (std::size_t j = 0; j < pattern_.size(); ++j) {
    const std::uint32_t node = pattern_.nodes[j];
    const double add = shift.per_mass * mass_kg_[node] + shift.per_damping * mass_damping_[node];
    double* block = values.data() + 9 * std::size_t{pattern_.starts[j]};
    for (int i = 0; i < 9; i += 4) block[i] += add;
  }
  const double viscosity_s = description_.materials.front().stiffness_damping_s;
  const double viscous = 1.0 + shift.stiffening + shift.per_viscosity * viscosity_s;
  for (const Attachment& one : description_.attachments) {
    const std::int32_t row = pattern_.row_of[one.node];
    if (row < 0) continue;
    const double scale = one.is_tie() ? 1.0 + shift.stiffening : viscous;
    double* block = values.data() + 9 * std::size_t{pattern_.starts[static_cast<std::size_t>(row)]};
    for (int i = 0; i < 9; i += 4) block[i] += scale * one.stiffness_newton_per_m;
  }
}

std::vector<double> no_rotations(std::size_t nodes) {
  std::vector<double> rotations(4 * nodes, 0.0);
  for (std::size_t i = 0; i < rotations.size(); i += 4) rotations[i] = 1.0;
  return rotations;
}

void update_node_rotations(ElementBatches& batches, const VectorXd& x_m,
                           std::vector<double>& rotations, std::vector<double>& work) {
  const Pack* quaternions = update_rotations(batches, x_m.data());
  std::fill(work.begin(), work.end(), 0.0);
  const auto per = static_cast<std::size_t>(batches.nodes_per_element);
  for (std::size_t b = 0; b < batches.batches; ++b) {
    const Pack* q = quaternions + 4 * b;
    const std::uint32_t* nodes = batches.nodes.data() + b * per * kLanes;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const double w = q[0].v[lane];
      const double x = q[1].v[lane];
      const double y = q[2].v[lane];
      const double z = q[3].v[lane];
      for (std::size_t a = 0; a < per; ++a) {
        const std::size_t node = 4 * std::size_t{nodes[a * kLanes + lane]};
        const double* old = rotations.data() + node;
        double* sum = work.data() + node;
        // a quaternion and its opposite are the same rotation
        const double side = old[0] * w + old[1] * x + old[2] * y + old[3] * z;
        const double sign = side < 0.0 ? -1.0 : 1.0;
        sum[0] += sign * w;
        sum[1] += sign * x;
        sum[2] += sign * y;
        sum[3] += sign * z;
      }
    }
  }
  for (std::size_t i = 0; i < work.size(); i += 4) {
    const double* s = work.data() + i;
    const double length = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]);
    if (!(length > 1e-3)) continue;
    for (std::size_t k = 0; k < 4; ++k) rotations[i + k] = s[k] / length;
  }
}

}  // namespace palpate::elastic
