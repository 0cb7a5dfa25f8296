// SPDX-License-Identifier: Apache-2.0
// touching_bodies.h — elastic bodies of a scene that touch each other, solved together.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "physics_node/elastic/contact/plane_contact.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/touching/body_ties.h"

namespace palpate::physics {

/// The contact of two bodies: nodes of the surface of each in front of the triangles of the other.
/// A node that is outside meets the nearest triangle, with its smooth normal, or beside an edge a
/// plane across the way to it. One that is inside comes out where its own surface looks, or where
/// it was pressed before. Each of them is one force λ along the smooth normal of the triangle, on
/// the node and, the other way round, on its corners; with friction (Coulomb) another one along the
/// triangle: a spring of the stiffness of the penalty from the place where the node is stuck, which
/// slips at µ λ.
class BodyPair {
 public:
  BodyPair(std::size_t first, std::size_t second, double friction_coefficient)
      : members_{first, second}, friction_coefficient_(friction_coefficient) {}

  [[nodiscard]] const std::array<std::size_t, 2>& members() const noexcept { return members_; }
  /// Before a step: which nodes may touch in it. Bodies that are apart cost their bounds.
  void look(const ElasticSimulation& first, const ElasticSimulation& second, double step_s);
  [[nodiscard]] bool is_near() const noexcept { return !touches_.empty(); }
  /// The planes for one of the two, while the other is where it is. Appends.
  void add_planes(const ElasticSimulation& first, const ElasticSimulation& second, bool is_second,
                  std::vector<elastic::ContactPlane>& planes) const;
  /// After a pass: λ becomes the force. @return  the largest gap where something presses [m]
  double update(const ElasticSimulation& first, const ElasticSimulation& second);
  /// On the first of the two.
  [[nodiscard]] Vector3 force_on_first_newton() const noexcept;
  /// Of the node that is farthest inside the other body, of those that may touch; 0: none is.
  [[nodiscard]] double deepest_m(const ElasticSimulation& first,
                                 const ElasticSimulation& second) const;

  struct Touch {
    bool is_second = false;  ///< its node is of the second body
    std::uint32_t node = 0;
    std::array<std::uint32_t, 3> triangle{};  ///< of the other body
    Vector3 weights = Vector3::Zero();
    Vector3 normal = Vector3::UnitZ();  ///< out of the triangle
    double stiffness_newton_per_m = 0.0;
    double multiplier_newton = 0.0;
    /// From the triangle's point to the node where friction would not act; only along the triangle.
    Vector3 stuck_m = Vector3::Zero();
    Vector3 friction_newton = Vector3::Zero();  ///< on the node

    [[nodiscard]] elastic::SurfacePoint node_point() const noexcept;
    [[nodiscard]] elastic::SurfacePoint triangle_point() const noexcept;
    [[nodiscard]] double gap_m(const elastic::VectorXd& of_node,
                               const elastic::VectorXd& of_triangle) const noexcept;
    /// Along the triangle, from where it is stuck.
    [[nodiscard]] Vector3 slid_m(const elastic::VectorXd& of_node,
                                 const elastic::VectorXd& of_triangle) const noexcept;
  };
  /// Friction holds it: it does not slip.
  [[nodiscard]] bool is_stuck(const Touch& one) const noexcept {
    constexpr double kSlips = 0.999;
    return one.friction_newton.norm() < kSlips * friction_coefficient_ * one.multiplier_newton;
  }
  [[nodiscard]] const std::vector<Touch>& touches() const noexcept { return touches_; }

 private:
  void look(const ElasticSimulation& nodes, const ElasticSimulation& triangles, bool is_second,
            double margin_m, std::vector<Touch>& touches) const;

  std::array<std::size_t, 2> members_;
  double friction_coefficient_;
  std::vector<Touch> touches_;
  std::array<const ElasticBody*, 2> of_{};  // of touches_
};

/// Bodies that may touch each other or are tied together, directly or through others.
class Island {
 public:
  /// Of each island, its bodies: indices of `bodies`, ascending. One that touches no other is one
  /// by itself.
  [[nodiscard]] static std::vector<std::vector<std::size_t>> of(
      std::span<const ElasticBody* const> bodies);

  /// @param bodies  of this island
  explicit Island(std::span<const ElasticBody* const> bodies);

  /// One step of all: each by itself as ElasticSimulation::step(), and where two are near, again
  /// with the forces between them until these no longer change much, at most kMostPasses times.
  /// What is at rest, and touched by nothing that moves, is skipped.
  /// @param tips  of each body   @param may_tear  what ties bodies together
  /// @return  of each, whether it made a step
  std::vector<char> step(std::span<ElasticSimulation* const> bodies,
                         std::span<const std::span<const std::optional<TipState>>> tips,
                         std::optional<double> step_s, bool may_tear = true);

  /// Where one body leans on the others, after step().
  /// @param compliances  of each body
  [[nodiscard]] std::vector<elastic::Support> supports_of(
      std::size_t body, std::span<elastic::SurfaceCompliance* const> compliances) const;

  /// Where one body is tied to others, after step().   @param compliances  of each body
  [[nodiscard]] std::vector<elastic::TiePoint> tie_points_of(
      std::size_t body, std::span<elastic::SurfaceCompliance* const> compliances) const;

  [[nodiscard]] const std::vector<BodyPair>& pairs() const noexcept { return pairs_; }
  [[nodiscard]] const std::vector<BodyTies>& ties() const noexcept { return ties_; }

  static constexpr int kMostPasses = 12;

 private:
  void share_energy(std::span<ElasticSimulation* const> bodies) const;

  std::vector<BodyPair> pairs_;
  std::vector<BodyTies> ties_;
};

}  // namespace palpate::physics
