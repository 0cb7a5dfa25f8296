// SPDX-License-Identifier: Apache-2.0
// contact_check.h — compares condensed contacts with the whole body while they are in use, on a
// slow thread.
#pragma once

#include <vector>

#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/equilibrium.h"

namespace palpate::elastic {

struct ContactCheckReport {
  SearchReport search;
  /// Relative error of the way that the condensed contact expected for its forces: f·(x − expected
  /// x) / f·(x − x without forces). NaN: no force.
  double error_ratio = 0.0;
};

/// The body under the forces that a condensed contact found is in equilibrium somewhere: there it
/// is looked for, with the factor of the compliance, turned. The difference from what the condensed
/// contact expected is its error, and the equilibrium one that the next condensed contact starts
/// from. The cost is a few solutions with the factor.
class ContactCheck {
 public:
  /// All are referred to.   @param factor  that of the compliance
  /// @throws std::runtime_error  the stiffness could not be factorised
  ContactCheck(const Body& body, WarpedFactor& factor, SurfaceCompliance& compliance,
               const std::vector<SurfacePoint>& points);

  /// Before the first contact with a place: presses it by fictitious indentations of up to
  /// kFictitiousDepth of the radius, so that `next` starts from their equilibria and knows its
  /// error between them. Allocates.
  ContactCheckReport begin(const Vector3d& centre_m, double radius_m, int most_points,
                           CondensedContact& next);

  /// Looks for the equilibrium under the forces of a snapshot of the condensed contact in use;
  /// prepares `next` with it, for a sphere at `centre_m`. Allocates.
  ContactCheckReport check(const CondensedContact::Snapshot& snapshot, const Vector3d& centre_m,
                           int most_points, CondensedContact& next);

  static constexpr double kFictitiousDepth = 0.2;
  static constexpr int kFictitious = 4;

  /// Factorises at the last equilibrium and forgets the columns: due when error_ratio stays large.
  /// False: the stiffness is not positive definite there; that of projected tangents is used.
  bool renew_factor();

  /// The last equilibrium.
  [[nodiscard]] const VectorXd& x_m() const noexcept { return x_; }
  [[nodiscard]] const EquilibriumSearch& search() const noexcept { return search_; }

 private:
  struct Equilibrium {
    VectorXd x_m;
    std::vector<Vector3d> forces_newton;  // per point, on the body
    double sum_newton = 0.0;              // of their sizes
  };
  SearchReport balance(const CondensedContact::Snapshot& snapshot, Equilibrium& found);
  [[nodiscard]] double error_ratio(const CondensedContact::Snapshot& snapshot) const;
  void prepare(const Equilibrium& first, const Vector3d& centre_m, int most_points,
               CondensedContact& next);

  WarpedFactor& factor_;
  SurfaceCompliance& compliance_;
  const std::vector<SurfacePoint>& points_;
  EquilibriumSearch search_;
  VectorXd x_;
  std::vector<Equilibrium> equilibria_;   // the first without forces
  std::vector<double> factor_rotations_;  // where the factor was made
};

}  // namespace palpate::elastic
