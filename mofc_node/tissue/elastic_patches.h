// SPDX-License-Identifier: Apache-2.0
// elastic_patches.h — the contact with elastic bodies, solved at the device's rate.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/core/elastic/elastic_patch.h"
#include "common/core/messages.h"
#include "mofc_node/tissue/local_tissues.h"

namespace palpate::mofc {

/// Keeps what physics_node has sent of elastic bodies (ElasticPoint, ElasticState), and solves the
/// contact of the tip with them as physics_node does between two solutions of the body (sweep()).
///
/// A step is valid if the tip touches listed points only, and all of these have arrived that the
/// tip may touch or that carry a force. A model of the contact begins with the forces of its state
/// where the tip was in that, and goes from there to where the tip is in steps of at most a quarter
/// of its radius: what the model before it had wrong ends with it. Between two models the force
/// changes as in ModelHandover. Until a model is there, and beyond its points, the contact model of
/// the Interaction counts.
///
/// 1.5 MB, allocated by the constructor. The other functions neither allocate nor throw. A step
/// takes at most kMostSteps sweeps of a sphere for each patch, a sweep changes kMostChanges forces
/// at most, and together they do no more than `most_work`: the last sweep ends early, and goes on
/// in the next step; a patch for which nothing is left keeps its force, and its step is invalid.
class ElasticPatches {
 public:
  using Result = LocalTissues::Result;
  static constexpr int kMostSteps = 3;
  static constexpr int kMostSweeps = 16;
  static constexpr int kMostChanges = 256;

  explicit ElasticPatches(double newton_per_s);
  ~ElasticPatches();
  ElasticPatches(const ElasticPatches&) = delete;
  ElasticPatches& operator=(const ElasticPatches&) = delete;

  /// Takes what one Interaction carries.
  /// @param store_id  of the store now; a new one empties it
  /// @param age_s  ≥ 0, of the loop: since the DeviceState that it answers to
  void take(const Interaction& interaction, std::uint64_t store_id, double age_s) noexcept;
  [[nodiscard]] const ElasticReceipts& receipts() const noexcept { return receipts_; }

  /// The tool is elsewhere: what follows does not continue what was.
  void reset() noexcept;

  /// @param newest  where friction begins   @param dt_s  ≥ 0, since the step before
  /// @param scene_s  of moving tissue, now
  /// @param most_work  in the units of LocalTissues::work_in()
  void step(const Interaction& newest, const Vector3& tip_m, double dt_s, double scene_s,
            std::uint32_t most_work) noexcept;
  /// Of the last step.
  [[nodiscard]] std::uint32_t work() const noexcept { return work_; }
  [[nodiscard]] const std::array<Result, kMaxElasticPatches>& results() const noexcept {
    return results_;
  }

 private:
  struct Model;
  class Patch;
  /// What all patches of a step share.
  struct Budget {
    std::uint32_t left = 0;
    std::uint32_t used = 0;

    void take(std::uint32_t some) noexcept {
      used += some;
      left -= std::min(left, some);
    }
  };
  double newton_per_s_;
  std::uint64_t store_id_ = 0;
  ElasticReceipts receipts_;
  std::vector<Patch> patches_;
  std::array<Result, kMaxElasticPatches> results_{};
  std::uint32_t work_ = 0;
};

}  // namespace palpate::mofc
