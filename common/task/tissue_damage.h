// SPDX-License-Identifier: Apache-2.0
// tissue_damage.h — how hard single tissues were pressed beyond what they bear: figures, and
// sentences for people who do not read plots. What each figure means: docs/tasks.md.
#pragma once

#include <cstddef>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/core/scene_messages.h"
#include "common/core/vector.h"
#include "common/session/task_config.h"
#include "common/task/force_figures.h"
#include "common/task/searched_surface.h"

namespace palpate {

struct TissueDamage {
  std::string name{};
  double most_force_newton = kNotKnown;     ///< limit
  double most_damage_newton_s = kNotKnown;  ///< limit
  bool is_seen = false;                     ///< its surface was received
  ForceFigures force{};                     ///< while the tip touches it
  double overshoot_newton = 0.0;            ///< the largest force beyond the limit
  double beyond_s = 0.0;
  double damage_newton_s = 0.0;  ///< ∫ (F − limit) dt beyond it

  [[nodiscard]] bool is_damaged() const { return damage_newton_s > most_damage_newton_s; }
};

/// Which tissues with a limit the tip touches, from their surfaces at rest.
class TissueWatch {
 public:
  TissueWatch(const std::vector<TissueLimit>& limits, double tip_radius_m);

  [[nodiscard]] bool empty() const { return watched_.empty(); }
  /// Every surface is known.
  [[nodiscard]] bool has_all() const;
  /// Of each tissue the first surface with triangles counts.
  void take(const SceneState& scene);
  /// A tick with that force on the hand. A tip that touches several tissues presses on each.
  /// @param elapsed_s  that it stands for
  void count(const Vector3& tip_m, double newton, double elapsed_s);
  [[nodiscard]] std::vector<TissueDamage> figures() const;

 private:
  struct Watched {
    std::size_t tissue;  // in the scene
    TissueDamage damage;
    ForceCount forces{};
    std::unique_ptr<SearchedSurface> surface{};
  };
  [[nodiscard]] bool touches(const SearchedSurface& surface, const Vector3& tip_m) const;

  double tip_radius_m_;
  std::vector<Watched> watched_;
};

/// One sentence for each tissue that was pressed too hard, or was not seen.
[[nodiscard]] std::vector<std::string> findings_of(const std::vector<TissueDamage>& tissues);
/// Label and value with unit.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> figures_of(
    const std::vector<TissueDamage>& tissues);
/// Keys: docs/tasks.md.
[[nodiscard]] nlohmann::ordered_json tissues_json(const std::vector<TissueDamage>& tissues);

}  // namespace palpate
