// SPDX-License-Identifier: Apache-2.0
// trace.h — what a series of answers says about a physics.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "deploy/conform/mofc_side.h"

namespace palpate {

/// Work of the tissue on the tool along the trace, and of both signs together [J]: where it moves
/// by itself, as seen from its surface, less what it had stored.
[[nodiscard]] std::pair<double, double> work_joule(const std::vector<AnsweredPlace>& trace);

struct Variation {
  Vector3 mean_newton = Vector3::Zero();
  double range_newton = 0.0;
  double most_newton = 0.0;
};
/// Of the force, from the place of that number on.
[[nodiscard]] Variation variation_of(const std::vector<AnsweredPlace>& trace, std::size_t first);

/// A contact says that the tissue moves by itself.
[[nodiscard]] bool is_moving(const std::vector<AnsweredPlace>& trace);

}  // namespace palpate
