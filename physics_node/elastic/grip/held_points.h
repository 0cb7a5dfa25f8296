// SPDX-License-Identifier: Apache-2.0
// held_points.h — points of the surface of an elastic body that the jaws of a tool hold.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/sphere_contact.h"

namespace palpate::elastic {

/// Bilateral: each point is tied to a place that moves with the tool by a spring of the same
/// stiffness, ½ k Σ |x − (at + away)|². The jaws do not turn. Positive semidefinite, and of the
/// nodes of one face each, so that it needs no more of the matrix of the body.
class HeldPoints {
 public:
  /// Takes the nearest of the points within reach, where the body is now.
  /// @param newton_per_m  > 0, of all together
  /// @param rest_m  of the body: they are held as they lie to each other there, with no force all
  /// together; null: as they lie now
  void take(const std::vector<SurfacePoint>& points, const double* x_m, const Vector3d& at_m,
            double reach_m, std::size_t most, double newton_per_m, const double* rest_m = nullptr);
  /// Takes the nearest of the points to a straight edge in the body at rest. They are held as they
  /// lie there: with no force if the tool, less its slip, is at `origin_m`.
  /// @param rest_m  of the body   @return  how many there are; 0: it holds what it held
  std::size_t take_beside(const std::vector<SurfacePoint>& points, const double* rest_m,
                          const std::array<Vector3d, 2>& edge_m, double reach_m, std::size_t most,
                          double newton_per_m, const Vector3d& origin_m);
  /// They lie so much farther from the tool.
  void shift(const Vector3d& by_m) noexcept {
    for (Held& one : held_) one.away_m += by_m;
  }
  /// Where the tool, less its slip, has no force on one of them that stands still at rest. @pre  it
  /// holds
  [[nodiscard]] Vector3d origin_m(const double* rest_m) const noexcept {
    return held_.front().point.position_m(rest_m) - held_.front().away_m;
  }
  /// Their mean way from there.
  [[nodiscard]] Vector3d moved_m(const double* x_m, const double* rest_m) const noexcept;
  void let_go() noexcept { held_.clear(); }
  /// As those of another body, as far as they are still there.
  /// @param points      of this body   @param old_points  by point: its index there, −1: none
  void continue_as(const HeldPoints& other, const std::vector<SurfacePoint>& points,
                   const std::vector<std::int32_t>& old_points);
  [[nodiscard]] bool is_empty() const noexcept { return held_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return held_.size(); }

  /// Where the tool is, less its slip.
  void set_place(const Vector3d& at_m) noexcept { at_m_ = at_m; }
  [[nodiscard]] const Vector3d& place_m() const noexcept { return at_m_; }
  /// Adds the force on each point with the body there. @return  the sum of the opposite ones, which
  /// act on the tool
  Vector3d add_forces_on_body(const double* x_m, std::span<Vector3d> forces_newton) const noexcept;

  /// In the springs.
  [[nodiscard]] double stored_joule(const double* x_m) const noexcept;

  // as an obstacle; see obstacle.h
  double add_gradient(const double* x_m, double* gradient) const noexcept;
  void add_stiffness(const BlockPattern& pattern, BlockValues& values) const;

  struct Held {
    SurfacePoint point;
    std::size_t index;  // of the points that were given
    Vector3d away_m;    // from the tool, at the closing
  };
  [[nodiscard]] const std::vector<Held>& held() const noexcept { return held_; }
  /// Of one point's spring.
  [[nodiscard]] double newton_per_m() const noexcept { return newton_per_m_; }

 private:
  [[nodiscard]] Vector3d stretch_m(const Held& one, const double* x_m) const noexcept {
    return one.point.position_m(x_m) - at_m_ - one.away_m;
  }

  std::vector<Held> held_;
  Vector3d at_m_ = Vector3d::Zero();
  double newton_per_m_ = 0.0;
};

/// How the force on one of the tools that hold a body falls with the way of each: of tool i with
/// that of tool j, Jᵢᵀ (C + 1/k)⁻¹ Jⱼ with the compliance C of all held points at rest. Its own is
/// symmetric, and positive definite unless a number overflows; of a tool that holds nothing it is
/// 0. On the slow thread: a Cholesky of three rows a point. Makes the columns that it needs.
/// @param tools  all of the body   @param own  the index of the one
/// @throws std::runtime_error  as SurfaceCompliance::require
[[nodiscard]] std::vector<Eigen::Matrix3d> grip_stiffness_newton_per_m(
    SurfaceCompliance& compliance, std::span<const HeldPoints> tools, std::size_t own);

/// On a shorter way the creep of the body hides what the way changed.
inline constexpr double kShortestWay_m = 3e-4;

/// The stiffness that explains how the force changed between two solutions, with the least change
/// of `stiffness` to this [Nocedal06, BFGS]: stays symmetric and positive definite. Left as it is
/// if the way is shorter, or the two differ by more than a factor of three along it: then the
/// body moves.
/// @param fell_newton  force on the tool before less that after
[[nodiscard]] Eigen::Matrix3d updated_stiffness(const Eigen::Matrix3d& stiffness,
                                                const Vector3d& way_m, const Vector3d& fell_newton);

}  // namespace palpate::elastic
