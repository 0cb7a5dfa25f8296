// SPDX-License-Identifier: Apache-2.0
// contrast.h — how much harder a lesion makes its place, predicted by full solutions of the elastic
// body: the difficulty of finding it.
#pragma once

#include <cstddef>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate {

/// A slow press of the tip straight into a surface: forces along it at depths from 0 on.
struct PressCurve {
  static constexpr double kStep_m = 1e-3;

  std::vector<double> newton{};  ///< at i · kStep_m

  /// Of the least depth with this force; the last one where it is not reached.
  [[nodiscard]] double depth_m(double force_newton) const;
};

/// Presses at `above_m` against `normal` until the force is reached, at most `most_m` deep. Takes
/// some dozen full solutions.
[[nodiscard]] PressCurve press_curve(const physics::ElasticBody& body, double tip_radius_m,
                                     const Vector3& above_m, const Vector3& normal,
                                     double most_newton, double most_m);

/// What a press over a lesion is beside one on the body without it, at the same depth.
struct Contrast {
  /// Least force over the lesion that differs by more than the force JND
  /// (docs/theory.md §7.3); NaN: none up to the largest force.
  double palpable_newton = 0.0;
  double ratio = 0.0;  ///< (with − without) / without at the largest force that both reach
};
[[nodiscard]] Contrast contrast_of(const PressCurve& with, const PressCurve& without);

}  // namespace palpate
