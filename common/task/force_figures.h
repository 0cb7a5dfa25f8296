// SPDX-License-Identifier: Apache-2.0
// force_figures.h — forces on the hand while it touches, in figures and words.
#pragma once

#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/task/histogram.h"

namespace palpate {

inline constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// NaN where it never touched.
struct ForceFigures {
  double median_newton = kNotKnown;
  double p95_newton = kNotKnown;
  double most_newton = kNotKnown;
  double touch_s = 0.0;
};

/// The forces of one region.
class ForceCount {
 public:
  /// @param elapsed_s  that the tick stands for
  void add(double newton, double elapsed_s) {
    forces_.add(newton);
    touch_s_ += elapsed_s;
  }
  [[nodiscard]] double most_newton() const { return forces_.max(); }  ///< NaN without any
  [[nodiscard]] ForceFigures figures() const {
    return {.median_newton = forces_.quantile(0.5),
            .p95_newton = forces_.quantile(0.95),
            .most_newton = forces_.max(),
            .touch_s = touch_s_};
  }

 private:
  static constexpr double kBin_newton = 0.005;
  static constexpr std::size_t kBins = 10'000;

  Histogram forces_{kBin_newton, kBins};
  double touch_s_ = 0.0;
};

/// Force over the time of a task: the largest one in each of at most 600 slots of equal length.
struct ForceTrace {
  double slot_s = 0.1;
  std::vector<float> most_newton{};  ///< from the start on; NaN: no tick of it was received

  void add(double t_s, double newton);
};
[[nodiscard]] nlohmann::ordered_json trace_json(const ForceTrace& trace);

/// "1.00 N median, 2.00 N at 95 %, 2.10 N at most"
[[nodiscard]] std::string force_text(const ForceFigures& force);
[[nodiscard]] nlohmann::ordered_json force_json(const ForceFigures& force);

}  // namespace palpate
