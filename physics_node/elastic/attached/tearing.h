// SPDX-License-Identifier: Apache-2.0
// tearing.h — attachments that tear: traction over separation, with a toughness.
#pragma once

#include <cstdint>
#include <vector>

#include "physics_node/elastic/body.h"

namespace palpate::elastic {

/// A cohesive law of one length δ₀. With the stiffness k and the separation δ, the force is k δ up
/// to δ₀ and falls from there on a straight line to 0 at 2 δ₀:
///
///   f(δ) = k δ,  k (2 δ₀ − δ),  0
///
/// so that tearing takes ∫ f dδ = k δ₀². It goes back to 0 on a straight line from the largest
/// separation so far, and along it again [Ortiz99]. Lengths in m, areas under f/k in m².
struct CohesiveLaw {
  double softens_at_m = 0.0;  ///< δ₀ > 0

  /// Force over k δ, in [0, 1]. @param farthest_m  the largest separation so far
  [[nodiscard]] double ratio(double farthest_m) const noexcept;
  /// ∫₀^δ f/k.
  [[nodiscard]] double area_m2(double separation_m) const noexcept;
};

/// How far a point is from where its spring has no force.
struct Separation {
  Vector3d away_m;
  Vector3d apart_m;  ///< less what it has moved towards what it is attached to
  double pressed_m;  ///< that
};
/// @param outward  unit, towards what it is attached to
[[nodiscard]] Separation separation_of(const Vector3d& away_m, const Vector3d& outward) noexcept;

/// A spring with this law: pressing does not tear it. A step minimises the function of the law as
/// far as the point has come, so that it takes the toughness however long the step is.
struct CohesiveSpring {
  double newton_per_m = 0.0;  ///< k, of the intact one
  CohesiveLaw law;
  double farthest_m = 0.0;  ///< ≥ δ₀, at the end of a step so far
  Vector3d outward = Vector3d::UnitZ();

  struct Pull {
    double joule;
    Vector3d slope_newton;  ///< of that
  };
  [[nodiscard]] Pull pull(const Separation& at) const noexcept;
  /// Of the secant, less that of another spring in all directions.
  [[nodiscard]] Eigen::Matrix3d stiffness(const Separation& at,
                                          double less_newton_per_m) const noexcept;
};

/// The attachments of a body that tear, as an obstacle beside the body, which has springs in their
/// places: what they do more or less than these. What ties it to another body is counted only
/// (@see Tie). Deterministic. Copies are independent.
class Tearing {
 public:
  explicit Tearing(const Body& body);

  /// As the other one, of a body that this one's came from: an attachment that is no longer there
  /// was torn.
  void continue_as(const Tearing& other);

  /// Only the counts of the other one go on.
  void count_on(const Tearing& other) noexcept;

  /// It does what the springs of the body do.
  [[nodiscard]] bool is_idle() const noexcept;
  /// The end of a step, but for ties. @return whether anything has torn further
  bool note(const double* x_m) noexcept;
  /// The same for a tie. @param place  among attachments()
  bool note(std::size_t place, double apart_m) noexcept;

  struct One {
    Attachment attachment;
    Vector3d rest_m;          // of its node
    double farthest_m = 0.0;  // ≥ δ₀

    [[nodiscard]] CohesiveLaw law() const noexcept { return {attachment.softens_at_m}; }
    [[nodiscard]] double ratio() const noexcept { return law().ratio(farthest_m); }
    [[nodiscard]] CohesiveSpring spring() const noexcept {
      return {attachment.intact_newton_per_m, law(), farthest_m, attachment.outward};
    }
    /// Of the node from its rest.
    [[nodiscard]] Separation way(const double* x_m) const noexcept;
    [[nodiscard]] bool is_as_in_body(double apart_m) const noexcept;
  };
  [[nodiscard]] const std::vector<One>& attachments() const noexcept { return all_; }
  /// That hold nothing any more.
  [[nodiscard]] std::size_t torn() const noexcept;
  /// What tearing has taken so far.
  [[nodiscard]] double taken_joule() const noexcept;
  /// What they would give back, less what the springs of the body would; without ties.
  [[nodiscard]] double stored_joule(const double* x_m) const noexcept;

  // as an obstacle; see obstacle.h
  double add_gradient(const double* x_m, double* gradient) const noexcept;
  void add_stiffness(const double* x_m, const BlockPattern& pattern, BlockValues& values) const;

 private:
  std::vector<One> all_;
  std::size_t torn_ = 0;  // that are not among these
  double torn_joule_ = 0.0;
};

}  // namespace palpate::elastic
