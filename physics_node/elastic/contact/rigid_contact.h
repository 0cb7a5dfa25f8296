// SPDX-License-Identifier: Apache-2.0
// rigid_contact.h — an elastic body against surfaces that do not give way, such as bone.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/contact/surface.h"
#include "common/core/tissue.h"
#include "physics_node/elastic/contact/plane_contact.h"
#include "physics_node/elastic/equilibrium.h"

namespace palpate::elastic {

/// What a body touches and cannot move.
struct RigidNeighbor {
  std::string name{};                               ///< for messages
  std::shared_ptr<const palpate::Surface> surface;  ///< in W, closed; where no motion displaces it
  double friction_coefficient = 0.0;
  palpate::TissueMotionConfig motion{};  ///< that nothing stops; amplitude 0: it stands still
};

/// The nodes of the surface of a body, middles of edges too, against its neighbours. In a step each
/// node that is near meets the plane that touches the surface where the node is nearest to it;
/// begin_round() lays the planes anew. A node that has gone through keeps its plane while the
/// surface would show it another side. Nodes that are held fast take no part. A neighbour that
/// moves takes its planes and the places where friction holds along, so that friction is that of
/// the velocity relative to it. Copies are independent of one another.
class RigidContact : public Obstacle {
 public:
  /// @param body   must outlive it   @param faces  its surface
  RigidContact(const Body& body, const std::vector<Face>& faces,
               std::vector<RigidNeighbor> neighbors);

  [[nodiscard]] bool is_there() const noexcept { return !neighbors_.empty(); }
  /// One of the neighbours moves.
  [[nodiscard]] bool can_move() const noexcept { return !moved_m_.empty(); }
  /// From now on the neighbours are where their motion has them then. Before the first call they
  /// are where no motion displaces them.
  /// @param time_s  of the motion
  void move_to(double time_s) noexcept;
  /// The longest way that a neighbour would go in move_to().
  [[nodiscard]] double way_to_m(double time_s) const noexcept;
  /// Between where they are and where they would be after move_to(): that share of the way.
  void move_towards(double time_s, double share) noexcept;
  /// A node is near a neighbour that went somewhere in the last move_to().
  [[nodiscard]] bool is_carried() const noexcept;
  /// Before a step: which nodes may touch in it. Looks only at those that have moved as far as they
  /// were away, so that a body at rest costs a few additions a node.
  /// @param v_m_per_s  of all nodes; null: at rest
  void begin_step(const double* x_m, const double* v_m_per_s, double step_s);
  /// After a step: the forces become the multipliers, friction slips.
  void end_step(const double* x_m) noexcept;

  /// No node is near a neighbour.
  [[nodiscard]] bool is_idle() const noexcept { return near_.empty(); }

  double add_gradient(const double* x_m, double* gradient) const override;
  void add_stiffness(const double* x_m, const BlockPattern& pattern,
                     BlockValues& values) const override;
  bool begin_round(const double* x_m, const BlockPattern& pattern) override;

  /// The planes that pressed at the end of the last step.
  [[nodiscard]] std::vector<ContactPlane> pressed() const;
  /// What neighbours push the body with, where the last step ended.
  [[nodiscard]] Vector3d force_on_body_newton(const double* x_m) const noexcept;
  /// Of the node that is farthest inside a neighbour; 0: none is.
  [[nodiscard]] double deepest_m(const double* x_m) const noexcept;

  /// Of a node that presses and is farther from the surface than this another round is made.
  static constexpr double kClose_m = 2e-5;

 private:
  struct One {
    ContactPlane plane;
    std::uint32_t neighbor = 0;
    palpate::SurfaceHint hint{};
    Vector3d seen_m = Vector3d::Zero();  // where the surface was looked at last
    double clear_m = -1.0;               // and how far it was
    double margin_m = 0.0;               // nearer ones may touch in this step
    bool is_near = false;
  };
  void look(One& one, const Vector3d& at_m) const;
  [[nodiscard]] palpate::SurfaceView view(std::uint32_t neighbor, const Vector3d& at_m,
                                          palpate::SurfaceHint& hint) const;
  void gather();

  std::vector<RigidNeighbor> neighbors_;
  std::vector<Vector3d> moved_m_;     // of each neighbour; empty: none can move
  std::vector<Vector3d> last_way_m_;  // in the last move_to()
  std::vector<One> ones_;             // of each node and neighbour
  std::vector<std::uint32_t> near_;   // of ones_
  std::vector<One> seen_;             // in a round
};

/// Where the body rests on its neighbours. Starts at x and ends there. @see find_rest
[[nodiscard]] SearchReport find_rest(EquilibriumSearch& search, WarpedFactor& factor,
                                     RigidContact& contact, const SearchLimits& limits,
                                     VectorXd& x_m);

}  // namespace palpate::elastic
