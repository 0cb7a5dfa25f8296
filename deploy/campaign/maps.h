// SPDX-License-Identifier: Apache-2.0
// maps.h — maps of a campaign: a quantity over two of its dimensions, as text and as SVG.
#pragma once

#include <string>

#include "deploy/campaign/result_log.h"

namespace palpate::campaign {

/// How the runs of one place of a map become one number.
enum class Merge : std::uint8_t { kMean, kLeast, kGreatest };

struct MapRequest {
  std::string across;    ///< name of a cartesian dimension; empty: the last one
  std::string down;      ///< another one; empty: the one before it
  std::string quantity;  ///< empty: the first one of the campaign
  Merge merge = Merge::kMean;
};

/// One map for each combination of the other cartesian dimensions. Throws SetupError if the
/// campaign lacks what the request names.
[[nodiscard]] std::string map_text(const Campaign& campaign, const Results& results,
                                   const MapRequest& request);
/// The same maps in one picture, dark for small values, light for great ones.
[[nodiscard]] std::string map_svg(const Campaign& campaign, const Results& results,
                                  const MapRequest& request);

}  // namespace palpate::campaign
