// SPDX-License-Identifier: Apache-2.0
// elastic_tissues.h — the elastic bodies of a scene, shared by its tools, and when they are solved.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "common/session/scene_config.h"
#include "common/telemetry/physics_telemetry.h"
#include "physics_node/elastic_tissue/elastic_tissue.h"
#include "physics_node/elastic_tissue/touching/tissue_island.h"
#include "physics_node/scene/scene_force.h"

namespace palpate::physics {

/// When full solutions are computed.
enum class ElasticPace : std::uint8_t {
  kThread,  ///< on a thread of their own, in real time; step() is real-time safe
  /// Within step(), by its time: a solution takes a period, or a quarter of it while a tip is fast,
  /// and is used from then on. Deterministic
  kVirtual,
  /// The same to the bit, for many simulations: what a solution can make again is not kept until
  /// the next. Step() allocates
  kFolded,
};

/// @param columns_folder  @see BodyCompliance; may be empty
[[nodiscard]] std::vector<std::shared_ptr<BodyCompliance>> compliances_of(
    const std::vector<std::shared_ptr<const ElasticBody>>& bodies,
    const std::filesystem::path& columns_folder = {});

/// Two tools that press on one body feel each other through it.
class ElasticTissues {
 public:
  /// nullptr if the scene has no elastic tissue: then nothing of all this is made.
  /// @param columns_folder  @see BodyCompliance; may be empty
  /// @throws SetupError  @see make_elastic_body
  [[nodiscard]] static std::shared_ptr<ElasticTissues> of(
      const SceneConfig& scene, std::size_t tools, ElasticPace pace,
      const std::filesystem::path& columns_folder = {});
  ElasticTissues(const std::vector<std::shared_ptr<const ElasticBody>>& bodies, std::size_t tools,
                 double tip_radius_m, ElasticPace pace,
                 const std::filesystem::path& columns_folder = {},
                 const std::optional<GripperConfig>& gripper = {},
                 const std::optional<ElectrodeConfig>& electrode = {})
      : ElasticTissues(compliances_of(bodies, columns_folder), tools, tip_radius_m, pace, gripper,
                       electrode) {}
  /// @param bodies   which other simulations may share
  /// @param gripper, electrode  of every tool; none: they only touch
  ElasticTissues(const std::vector<std::shared_ptr<BodyCompliance>>& bodies, std::size_t tools,
                 double tip_radius_m, ElasticPace pace,
                 const std::optional<GripperConfig>& gripper = {},
                 const std::optional<ElectrodeConfig>& electrode = {});
  ~ElasticTissues();
  ElasticTissues(const ElasticTissues&) = delete;
  ElasticTissues& operator=(const ElasticTissues&) = delete;

  /// Continues as the other would, to the bit. @pre  none kThread, both of the same bodies, as many
  /// tools
  void continue_as(const ElasticTissues& other);

  /// Adds the contacts of one tool.
  /// @param reach_m  bodies this near are described before they are touched
  /// @param jaw      of that tool; where they close, they take the nearest body
  /// @param is_energised  its electrode
  void step(std::size_t tool, const Vector3& tip_m, double time_s, double reach_m, SceneForce& sum,
            const JawInput& jaw = {}, bool is_energised = false) noexcept;
  [[nodiscard]] const std::optional<GripperConfig>& gripper() const noexcept { return gripper_; }
  /// An elastic tissue of the scene is again as in the session, from its next full solution on.
  /// @pre  an electrode, or it can tear
  void restore(std::uint32_t tissue) noexcept;
  [[nodiscard]] const std::optional<ElectrodeConfig>& electrode() const noexcept {
    return electrode_;
  }

  /// @see ElasticTissue::describe_ahead. Before step()
  void describe_ahead(std::size_t tool, const Vector3& velocity_m_per_s, double age_s) noexcept {
    for (auto& tissue : tissues_) tissue->describe_ahead(tool, velocity_m_per_s, age_s);
  }

  /// All but the steps and the bound at the last one, which are the tool's. Any thread.
  void count_into(PhysicsCounters& counters) const noexcept;
  /// Of one tool, on its thread.
  void count_tool_into(std::size_t tool, PhysicsCounters& counters) const noexcept;

  [[nodiscard]] const std::vector<std::unique_ptr<ElasticTissue>>& tissues() const noexcept {
    return tissues_;
  }

 private:
  struct Counts {
    std::uint64_t skipped = 0;
    std::uint64_t in_contact = 0;
    std::uint64_t without_bound = 0;
    std::uint64_t energised = 0;
    double bound_newton = kUnknownNewton;
  };
  /// The jaws of a tool.
  struct Closing {
    std::uint32_t number = 0;  // so far
    bool is_closed = false;
    std::size_t tissue = 0;  // around which
  };
  void close(std::size_t tool, const JawInput& jaw) noexcept;
  void solve_until(double time_s);

  std::vector<std::unique_ptr<ElasticTissue>> tissues_;
  std::vector<TissueIsland> islands_;
  ElasticPace pace_;
  std::optional<GripperConfig> gripper_;
  std::optional<ElectrodeConfig> electrode_;
  std::vector<Counts> counts_;     // by tool
  std::vector<Closing> closings_;  // by tool
  // by island; virtual
  std::vector<double> last_solve_s_;
  std::vector<double> ready_s_;  // then that solution may be used
  std::vector<std::jthread> threads_;
};

}  // namespace palpate::physics
