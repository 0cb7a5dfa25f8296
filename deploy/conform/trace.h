// SPDX-License-Identifier: Apache-2.0
// trace.h — what a series of answers says about a physics.
#pragma once

#include <utility>
#include <vector>

#include "deploy/conform/mofc_side.h"

namespace palpate {

/// Work of the tissue on the tool along the trace, and of both signs together [J].
[[nodiscard]] std::pair<double, double> work_joule(const std::vector<AnsweredPlace>& trace);

struct Variation {
  Vector3 mean_newton = Vector3::Zero();
  double range_newton = 0.0;
  double most_newton = 0.0;
};
/// Of the force, over the last two thirds.
[[nodiscard]] Variation variation_of(const std::vector<AnsweredPlace>& trace);

/// What the contact models predict for the next places, beside the forces answered there.
class ModelComparison {
 public:
  void add(const std::vector<AnsweredPlace>& trace);

  /// Actual change of the force along the predicted one, as a share of that; 1 without models.
  [[nodiscard]] double ratio() const { return predicted_ > 0.0 ? actual_ / predicted_ : 1.0; }
  /// Root of the sum of the squares of the predicted changes.
  [[nodiscard]] double predicted_newton() const;

 private:
  double predicted_ = 0.0;  // sums of predicted², predicted · actual [N²]
  double actual_ = 0.0;
};

}  // namespace palpate
