// SPDX-License-Identifier: Apache-2.0
#include "common/task/force_figures.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {
namespace {

constexpr std::size_t kMostSlots = 600;

}  // namespace

void ForceTrace::add(double t_s, double newton) {
  if (!(t_s >= 0.0)) return;
  auto slot = static_cast<std::size_t>(t_s / slot_s);
  for (; slot >= kMostSlots; slot /= 2) {
    // two slots become one
    for (std::size_t i = 0; i < most_newton.size(); i += 2) {
      const float next = i + 1 < most_newton.size() ? most_newton[i + 1] : most_newton[i];
      most_newton[i / 2] = std::fmax(most_newton[i], next);
    }
    most_newton.resize((most_newton.size() + 1) / 2);
    slot_s *= 2.0;
  }
  if (slot >= most_newton.size()) most_newton.resize(slot + 1, static_cast<float>(kNotKnown));
  most_newton[slot] = std::fmax(most_newton[slot], static_cast<float>(newton));
}

nlohmann::ordered_json trace_json(const ForceTrace& trace) {
  nlohmann::ordered_json json{{"slot_s", trace.slot_s}};
  json["most_n"] = nlohmann::ordered_json::array();
  for (const float newton : trace.most_newton) {
    json["most_n"].push_back(number_or_null(std::round(1e3 * static_cast<double>(newton)) / 1e3));
  }
  return json;
}

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
