// SPDX-License-Identifier: Apache-2.0
// body.h — an elastic body: mesh, materials, support; its masses, loads and stiffness.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "physics_node/elastic/element_batches.h"
#include "physics_node/elastic/linear/block_matrix.h"
#include "physics_node/elastic/linear/elimination_order.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::elastic {

using Eigen::VectorXd;

/// A spring from a node to its place in the mesh, equally stiff in all directions; in this place it
/// has no force. It has the viscosity of the first material and relaxes with the branches, unless
/// it ties the body to another one.
struct Attachment {
  std::uint32_t node = 0;
  double stiffness_newton_per_m = 0.0;
  // of one that tears @see Tearing
  double intact_newton_per_m = 0.0;      ///< k; 0: it does not tear
  double softens_at_m = 0.0;             ///< δ₀
  Vector3d outward = Vector3d::UnitZ();  ///< of the body, towards what it is attached to
  std::uint32_t index = 0;               ///< ascending; the same in all bodies made of one
  /// Of one to another body, which takes its place along @see Tie: index of that place; −1: none
  std::int32_t tie = -1;

  [[nodiscard]] bool tears() const noexcept { return intact_newton_per_m > 0.0; }
  [[nodiscard]] bool is_tie() const noexcept { return tie >= 0; }
};

struct BodyDescription {
  Mesh mesh;
  std::vector<Material> materials = {{}};  ///< one per region of the mesh
  Law law = Law::kCorotational;
  std::vector<std::uint32_t> fixed_nodes;
  Vector3d gravity_m_per_s2 = Vector3d::Zero();
  /// Besides gravity, the same wherever the body is, 3 per node [N]. Empty: none.
  VectorXd more_load_newton = {};
  /// Of all materials, whose moduli are those at rest; shares sum to less than 1.
  std::vector<Branch> branches = {};
  std::vector<Attachment> attachments = {};  ///< of ligaments; one or more per node
};

class SharedFactors;

/// What does not change while a body moves. Positions are vectors of 3 per node.
class Body {
 public:
  /// @throws std::invalid_argument  mesh not usable (quality_of), no fixed or attached node, a
  ///     node, region or material out of range
  /// @param before  of much the same elements: its order of elimination is used, as long as that
  ///     does not fill in much more; null: it is sought
  /// @param old_nodes  by node: which of that one it is or was split from; empty: the same one
  explicit Body(BodyDescription description, const Body* before = nullptr,
                std::span<const std::uint32_t> old_nodes = {});
  Body(const Body&) = delete;  // factors and simulations refer to it
  Body& operator=(const Body&) = delete;

  [[nodiscard]] const Mesh& mesh() const noexcept { return description_.mesh; }
  [[nodiscard]] const BodyDescription& description() const noexcept { return description_; }
  [[nodiscard]] const BlockPattern& pattern() const noexcept { return pattern_; }
  [[nodiscard]] const std::shared_ptr<const SymbolicFactor>& symbolic() const noexcept {
    return symbolic_;
  }
  /// Of all simulations of this body.
  [[nodiscard]] SharedFactors& shared_factors() const noexcept { return *shared_factors_; }
  [[nodiscard]] std::size_t node_count() const noexcept { return description_.mesh.nodes_m.size(); }
  [[nodiscard]] const VectorXd& rest_m() const noexcept { return rest_m_; }
  /// Lumped mass per node [kg] (quadratic elements: proportional to the diagonal of the consistent
  /// mass matrix, so that none is negative [Hinton76]).
  [[nodiscard]] const VectorXd& mass_kg() const noexcept { return mass_kg_; }
  /// α times mass, per node [kg/s].
  [[nodiscard]] const VectorXd& mass_damping_kg_per_s() const noexcept { return mass_damping_; }
  /// Gravity, consistent with the shape functions, and more_load_newton [N]. Empty without both.
  [[nodiscard]] const VectorXd& load_newton() const noexcept { return load_; }
  [[nodiscard]] bool is_viscous() const noexcept { return is_viscous_; }
  [[nodiscard]] bool has_mass_damping() const noexcept { return has_mass_damping_; }

  /// Whether the corners of an element stand inside out at x, or are in one plane.
  [[nodiscard]] bool has_inverted_element(const VectorXd& x_m) const;

  /// Elements and their state for one simulation of this body.
  [[nodiscard]] ElementBatches new_batches() const {
    return batches_of(description_.mesh, description_.materials, description_.law);
  }

  /// Adds the forces of the attachments at x to the gradient, as those of the elements.
  /// @param step_s    > 0: with the viscous ones of a step of this length
  /// @param before_m  positions at the start of that step
  /// @return their energy, with what the viscous ones dissipate
  double add_attachments(const double* x_m, const double* before_m, double step_s,
                         double* gradient) const noexcept;

  struct Shift {
    double per_mass = 0.0;       ///< added times the mass of each node
    double per_damping = 0.0;    ///< added times its mass damping
    double per_viscosity = 0.0;  ///< 1/h: with the viscous stiffness β/h
    double stiffening = 0.0;     ///< of the springs, by branches @see Relaxation
  };
  /// Stiffness at x. With `is_projected` every point's tangent is made positive semidefinite.
  /// @param rotations  start of the search for the elements' rotations: a quaternion per node
  void stiffness(const VectorXd& x_m, const std::vector<double>& rotations, const Shift& shift,
                 bool is_projected, BlockValues& values) const;

 private:
  void analyse_as(const Body& before, std::span<const std::uint32_t> old_nodes);

  BodyDescription description_;
  BlockPattern pattern_;
  std::shared_ptr<const SymbolicFactor> symbolic_;
  std::shared_ptr<SharedFactors> shared_factors_;
  VectorXd rest_m_;
  VectorXd mass_kg_;
  VectorXd mass_damping_;
  VectorXd load_;
  bool is_viscous_ = false;
  bool has_mass_damping_ = false;
};

/// No rotation: w, x, y, z = 1, 0, 0, 0 for each node.
[[nodiscard]] std::vector<double> no_rotations(std::size_t nodes);

/// Mean rotation of the elements around every node. `rotations` is the previous one. No allocation.
void update_node_rotations(ElementBatches& batches, const VectorXd& x_m,
                           std::vector<double>& rotations, std::vector<double>& work);

}  // namespace palpate::elastic
