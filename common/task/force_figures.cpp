// SPDX-License-Identifier: Apache-2.0
#include "common/task/force_figures.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {

std::string force_text(const ForceFigures& force) {
  if (!std::isfinite(force.most_newton)) return "never touched";
  return fmt::format("{:.2f} N median, {:.2f} N at 95 %, {:.2f} N at most", force.median_newton,
                     force.p95_newton, force.most_newton);
}

nlohmann::ordered_json force_json(const ForceFigures& force) {
  return {{"median_n", number_or_null(force.median_newton)},
          {"p95_n", number_or_null(force.p95_newton)},
          {"most_n", number_or_null(force.most_newton)},
          {"touch_s", force.touch_s}};
}

}  // namespace palpate
