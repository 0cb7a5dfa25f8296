// SPDX-License-Identifier: Apache-2.0
// tissue_scenes.h — the tissues of the benches, each with a path of the hand that shows its
// difficulty. Device 1 kHz with the default profile (0.055 mm, 3.3 N), hand as in the paper.
#pragma once

#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate::bench {

struct TissueScene {
  const char* name;
  const char* scene;  ///< text of the session's scene
  /// The intended path, from rest above the tissue.
  PathConfig path;
  double seconds;
};

/// Paper soft and rigid, 500 and 2000 N/m, stiffening: along the paper's V. Then sliding over a
/// sphere of 50 mm radius at 80 mm/s, over the edge of a stiff region, and a press into tissue that
/// moves and relaxes.
[[nodiscard]] std::vector<TissueScene> tissue_scenes();

/// The session of a scene, checked; `overrides` as --set. Throws SetupError.
[[nodiscard]] Session session_of(const TissueScene& scene,
                                 const std::vector<std::string>& overrides);

}  // namespace palpate::bench
