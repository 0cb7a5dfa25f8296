// SPDX-License-Identifier: Apache-2.0
// disturbed_scenes.h — the tissues that transparency_bench --disturbed palpates.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "tests/support/temp_folder.h"

namespace palpate::bench {

/// Rows of a scene: what is set in its session.
struct OwnDisturbance {
  std::string name;
  std::vector<std::string> overrides{};
};

struct DisturbedScene {
  std::string name;
  /// Throws SetupError.
  std::function<Session(const std::vector<std::string>& overrides)> session;
  bool has_all_disturbances = true;  ///< else only delays
  bool is_in_excerpt = true;
  double seconds = 10.0;                           ///< at most
  std::vector<OwnDisturbance> own_disturbances{};  ///< if any, after the undisturbed run only these
  bool has_uncontrolled = false;                   ///< each of those rows also without a controller
};

/// Real and rough surfaces, then one scene for each property of tissue.
/// @param folder  where surfaces are written that exist in no file
/// @param meshes  tetrahedral meshes (.msh, .vtk), scaled to a largest extent of 120 mm
/// @throws SetupError  if a mesh cannot be read
[[nodiscard]] std::vector<DisturbedScene> disturbed_scenes(const test::TempFolder& folder,
                                                           const std::vector<std::string>& meshes);

}  // namespace palpate::bench
