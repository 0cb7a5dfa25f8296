// SPDX-License-Identifier: Apache-2.0
// simulation.h — one scene under its tools, step by step, on a time of its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/core/time.h"
#include "physics_node/library/scene_tool.h"
#include "physics_node/library/shared_scene.h"

namespace palpate::physics {

/// One place where the tool touches a tissue; W.
struct TouchedPlace {
  Vector3 point_m = Vector3::Zero();  ///< of the surface as it is where no tool touches it
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue
  Vector3 force_on_tool_newton = Vector3::Zero();
  double penetration_m = 0.0;
  /// Bound of the error of the force against a full solution: 0 where the law is evaluated exactly;
  /// NaN: not known
  double error_newton = 0.0;
  std::uint32_t tissue = 0;
  bool is_shaft = false;  ///< else the tip
};

/// What the tissues do to one tool; W.
struct ToolForce {
  Vector3 force_on_tool_newton = Vector3::Zero();
  Vector3 torque_on_tool_newton_m = Vector3::Zero();  ///< about the centre of the tip
  double stored_energy_joule = 0.0;
  double error_newton = 0.0;                        ///< sum of the bounds of the places
  std::array<TouchedPlace, kMaxContacts> places{};  ///< deepest first
  std::uint32_t place_count = 0;                    ///< entries of `places`
  std::uint32_t contact_count = 0;                  ///< all; may be larger
};

/// Deterministic: the same steps give the same numbers to the bit, beside any others on other
/// threads. One thread calls it; allocates with elastic tissue.
class Simulation {
 public:
  /// @param tools  ≥ 1   @param is_folded  less memory and more time, @see ElasticPace::kFolded
  Simulation(std::shared_ptr<const SharedScene> shared, std::size_t tools, bool is_folded = false);

  /// All tools go on a straight way to these states, in `parts` equal parts of dt.
  /// @param tools  velocity none: that of this way   @param dt  > 0   @param parts  ≥ 1
  /// @param forces  one for each tool, at the end of the step
  struct Target {
    ToolState tool{};
    bool is_velocity_known = false;
  };
  void step(std::span<const Target> tools, Duration dt, std::uint32_t parts,
            std::span<ToolForce> forces);

  /// Of the last step.
  [[nodiscard]] TimePoint time() const noexcept { return time_; }
  /// The next step begins then, wherever tissue that moves by itself is at that time.
  void begin_at(TimePoint time) noexcept { time_ = time; }
  /// Continues as the other would, to the bit. @pre  of the same scene, as many tools
  void continue_as(const Simulation& other);

  /// Of the last full solution of an elastic tissue: the places of its display_mesh() and the
  /// equivalent strain √(⅔ dev E : dev E) there. False: it is not elastic.
  bool read_surface(std::size_t tissue, std::vector<float>& vertices_m,
                    std::vector<float>& strain) const;

  [[nodiscard]] const SharedScene& shared() const noexcept { return *shared_; }

 private:
  void describe(const SceneTool& tool, const ToolState& state, const SceneForce& force,
                ToolForce& out) const;

  std::shared_ptr<const SharedScene> shared_;
  std::shared_ptr<ElasticTissues> elastic_;  // null: none
  std::vector<SceneTool> tools_;
  std::vector<std::optional<ToolState>> last_;  // of the tools
  TimePoint time_{};
};

}  // namespace palpate::physics
