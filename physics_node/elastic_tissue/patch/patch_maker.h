// SPDX-License-Identifier: Apache-2.0
// patch_maker.h — the points of an elastic body near one tip, and the compliance between them, for
// mofc_node, which solves the contact itself (common/core/elastic/elastic_patch.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/elastic/elastic_patch.h"
#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

/// The content of the slots of a patch after a full solution: about 0.3 MB. The sender numbers the
/// patch.
struct ElasticPatch {
  struct Slot {
    ElasticPoint point{};     ///< version 0: nothing
    double distance_m = 0.0;  ///< elastic_distance_m() in the last state
  };
  std::vector<Slot> slots{};  ///< kElasticSlots, or empty: none yet
  ElasticState state{};       ///< number 0: none yet
};

/// Chooses the points: those that are pressed, then those that face the tip, nearest to its way
/// first. On the slow thread; allocates.
class PatchMaker {
 public:
  /// @param body, compliance  must outlive it
  PatchMaker(const ElasticBody& body, elastic::SurfaceCompliance& compliance, double tip_radius_m);
  /// Of a body that has replaced that of another one, the numbers of which go on.
  PatchMaker(const ElasticBody& body, elastic::SurfaceCompliance& compliance,
             const PatchMaker& before)
      : PatchMaker(body, compliance, before.tip_radius_m_) {
    next_version_ = before.next_version_;
    patch_.state.number = before.patch_.state.number;
  }

  struct Tip {
    Vector3 tip_m = Vector3::Zero();
    Vector3 ahead_m = Vector3::Zero();  ///< where it will be when this acts, from there
    Vector3 normal = Vector3::UnitZ();  ///< of the surface, on the tip's side
    /// A slot keeps its point for so many solutions after that was pressed.
    std::uint32_t held_solutions = 0;
    double gap_m = 0.0;  ///< from the centre of the tip to the untouched surface; < 0: below it
    // what the body lies on carries the surface here @see ElasticState
    Vector3 carried_m = Vector3::Zero();
    Vector3 carried_m_per_s = Vector3::Zero();
    double carried_at_s = 0.0;
    /// The body does not give way here as compliance() says @see ElasticState::radius_m
    bool is_void = false;
  };
  /// After a full solution. Makes the columns of few nodes that have none, nearest first: the
  /// points of the others come later.
  /// @param x_m, v_m_per_s  the body   @param is_alone  no other tool deforms it
  void update(const Tip& tip, const ElasticSimulation::Touch& touch, const elastic::VectorXd& x_m,
              const elastic::VectorXd& v_m_per_s, bool is_alone);

  [[nodiscard]] const ElasticPatch& patch() const noexcept { return patch_; }
  /// No point waits for its columns.
  [[nodiscard]] bool is_complete() const noexcept { return is_complete_; }

 private:
  struct Candidate {
    double order_m = 0.0;
    double distance_m = 0.0;
    std::uint32_t point = 0;
  };
  void gather(const ElasticSimulation::Touch& touch, const elastic::VectorXd& x_m);
  [[nodiscard]] bool is_ready(std::uint32_t point, int& most_columns);
  void require();
  /// Where it would be if nothing had carried the surface.
  [[nodiscard]] Vector3 place_m(std::uint32_t point, const elastic::VectorXd& x_m) const {
    return body_.points[point].position_m(x_m.data()) - patch_.state.carried_m;
  }
  void assign(std::uint32_t slot, std::uint32_t point);
  [[nodiscard]] Eigen::Matrix3d give(std::uint32_t at, std::uint32_t under) const;
  void describe(const ElasticSimulation::Touch& touch, const elastic::VectorXd& x_m,
                const elastic::VectorXd& v_m_per_s, bool is_alone);
  [[nodiscard]] double ratio_of(const std::array<Vector3, kElasticSlots>& forces,
                                const std::array<Vector3, kElasticSlots>& ways_m,
                                const std::array<Vector3, kElasticSlots>& rates_m) const;

  const ElasticBody& body_;
  elastic::SurfaceCompliance& compliance_;
  elastic::SurfaceCompliance::Required columns_;  // of the points that are there
  double tip_radius_m_;
  ElasticPatch patch_;
  std::array<std::optional<std::uint32_t>, kElasticSlots> point_in_;
  std::array<std::uint32_t, kElasticSlots> pressed_at_{};  // number of the state; 0: never
  std::vector<std::int16_t> slot_of_;                      // by point of the body; −1: none
  std::vector<Candidate> candidates_;
  std::vector<std::uint32_t> nodes_;  // whose columns new points need
  std::uint32_t next_version_ = 1;
  bool is_complete_ = false;
};

}  // namespace palpate::physics
