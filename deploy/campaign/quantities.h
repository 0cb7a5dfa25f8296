// SPDX-License-Identifier: Apache-2.0
// quantities.h — the numbers of a run that a campaign can report and limit.
#pragma once

#include <span>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/summary.h"

namespace palpate::campaign {

struct Quantity {
  const char* name;     ///< as in the JSON summary of `palpate loopback` where it is there
  const char* meaning;  ///< one line, with the unit
  bool needs_ideal;     ///< the run computes the ideal run too, which doubles its time
  double (*of)(const RunReport&, const Side&);  ///< NaN: not known
};

/// All of them.
[[nodiscard]] std::span<const Quantity> quantities();

/// The one of that name; nullptr if there is none.
[[nodiscard]] const Quantity* find_quantity(const std::string& name);

}  // namespace palpate::campaign
