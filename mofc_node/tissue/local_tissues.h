// SPDX-License-Identifier: Apache-2.0
// local_tissues.h — the tissues that physics_node has described, stepped at the device's rate.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "common/contact/contact_model.h"
#include "common/contact/relaxation.h"
#include "common/contact/tissue_step.h"
#include "common/core/messages.h"
#include "common/core/time.h"
#include "mofc_node/tissue/physics_clock.h"
#include "mofc_node/tissue/tissue_store.h"

namespace palpate::mofc {

/// Keeps what each described tissue remembers of the tool (proxy, stretch of friction, relaxation,
/// puncture) and steps it with every DeviceState, as Scene::step() does with the whole surface. A
/// tissue without memory continues from the newest Interaction.
///
/// A step is valid if no part of the surface that is not known could have changed it: the views of
/// the step do not depend on it, or the tool, which nothing held, stays in a ball around its last
/// place, or around the reference of an Interaction, that no part of the tissue reaches into. After
/// an invalid step the tissue is only followed while it still has a share in the force; without
/// one a step that is invalid at the tip ends there, and the other tissues have its views.
///
/// A step of all tissues takes at most about 64 views of their surfaces, 28 for each beyond that,
/// and 30 more for each shaft; a proxy that needs more goes on in the next step. Of tiles the views
/// look at no more than `most_work` together, whatever is described. Tissue that pushes the tool
/// has its turn first, then the rest, each in the order of the slots. A tissue for which nothing is
/// left is not stepped: its result is invalid, with the force of its last step as long as that has
/// a share. No allocation, no throw.
class LocalTissues {
 public:
  /// @see SurfaceHint; about 0.25 ms. A tip on an organ takes less than a thirtieth of it.
  static constexpr std::uint32_t kMostWork = 100000;
  /// What a step of a device with this period may take: less where it has less than 1 ms.
  [[nodiscard]] static constexpr std::uint32_t work_in(Duration period) noexcept {
    constexpr Duration kEnough = std::chrono::milliseconds(1);
    if (period >= kEnough) return kMostWork;
    return static_cast<std::uint32_t>(kMostWork * period.count() / kEnough.count());
  }

  struct Result {
    bool is_stepped = false;
    bool is_valid = false;
    std::uint32_t tissue = 0;
    ModelForce force{};
  };

  /// The tool has left the tissue: there is no memory of it.
  void reset() noexcept;

  /// @param now     its time is that of physics' clock
  /// @param shares     of each tissue's result in the force now, 0 … 1
  /// @param most_work  @see work_in()
  void step(std::array<DescribedTissue, kMaxDescribed>& tissues, const Interaction& newest,
            const ToolPose& now, const ToolVelocity& tool_velocity_world,
            const std::array<double, kMaxDescribed>& shares, std::uint32_t most_work) noexcept;

  [[nodiscard]] const std::array<Result, kMaxDescribed>& results() const noexcept {
    return results_;
  }
  /// Work of the last step, and whether some tissue had too little.
  [[nodiscard]] std::uint32_t work() const noexcept { return work_; }
  [[nodiscard]] bool is_exhausted() const noexcept { return is_exhausted_; }

 private:
  /// No part of the tissue reaches into this ball; in its rest frame.
  struct FreeBall {
    Vector3 center_m = Vector3::Zero();
    double radius_m = 0.0;

    /// How far from this place no part of the tissue can be.
    [[nodiscard]] double around_m(const Vector3& point_m) const noexcept {
      return radius_m - (point_m - center_m).norm();
    }
  };
  struct Memory {
    bool is_used = false;  // since it was last emptied
    bool is_begun = false;
    std::uint32_t version = 0;  // of the description
    std::optional<Touch> tip{};
    std::optional<Touch> shaft{};
    ShaftSearch shaft_search{};
    RelaxationState relaxation{};
    std::optional<ToolPose> pose{};
    FreeBall free{};
    ModelForce force{};  // of the last step
    // A tissue that nobody uses yet catches up with the tool on ways that are not too much work,
    // and along which enough is known.
    double most_way_m = std::numeric_limits<double>::infinity();
    bool is_behind = false;
  };
  /// All but which description it is of, and how far it may go.
  static void forget(Memory& memory) noexcept;
  static void begin(const DescribedTissue& tissue, const Interaction& newest, const ToolPose& now,
                    Memory& memory) noexcept;
  /// What all tissues of a step share.
  struct Budget {
    std::uint32_t views = 0;
    std::uint32_t work = 0;
    std::uint32_t used = 0;
    bool is_exhausted = false;

    /// @returns whether there is more
    bool take(std::uint32_t some) noexcept {
      is_exhausted = is_exhausted || some > work;
      used += some;
      work -= std::min(work, some);
      return work > 0;
    }
  };
  static Result step_one(DescribedTissue& tissue, const Interaction& newest, const ToolPose& now,
                         const ToolVelocity& velocity, bool has_share, Memory& memory,
                         Budget& left) noexcept;
  /// @param has_share  an invalid result counts too
  /// @param left       reduced by what this tissue needs; none if it needed more
  static std::optional<Result> advance(DescribedTissue& tissue, const ToolPose& now,
                                       const ToolVelocity& velocity, bool has_share, Memory& memory,
                                       Budget& left) noexcept;

  std::array<Memory, kMaxDescribed> memories_;
  std::array<Result, kMaxDescribed> results_;
  std::uint32_t work_ = 0;
  bool is_exhausted_ = false;
};

}  // namespace palpate::mofc
