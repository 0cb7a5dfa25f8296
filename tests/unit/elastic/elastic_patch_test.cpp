// SPDX-License-Identifier: Apache-2.0
// What physics_node sends of an elastic body so that mofc_node solves the contact itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include "common/core/random.h"
#include "mofc_node/tissue/tissue_model.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/elastic_tissue/patch_sender.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate::physics {
namespace {

constexpr double kPatchBall_m = 0.006;
constexpr double kPatchTick_s = 1e-3;

/// 100 × 100 × 50 mm, its top at z = 0, of 540 linear tetrahedra.
SceneConfig block_scene(const std::string& file) {
  const elastic::Mesh block = elastic::block_mesh(3, 3, 9e-3);
  TetrahedralMesh mesh;
  for (const Vector3& node_m : block.nodes_m) {
    mesh.nodes_m.emplace_back(node_m - Vector3(0.05, 0.05, 0.05));
  }
  for (std::size_t e = 0; e < block.element_count(); ++e) {
    const auto corners = block.element(e);
    mesh.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
  }
  std::ofstream(file) << msh_text(mesh);
  ElasticMaterial material;
  material.young_pa = 15e3;
  material.is_linear = true;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  return {.tip_radius_m = kPatchBall_m,
          .tissues = {
              {.name = "block",
               .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file},
               .material = material}}};
}

class SentPatch : public testing::Test {
 protected:
  SentPatch() : bodies_(elastic_bodies_of(block_scene(file_))) {
    tissues_.emplace(bodies_, 1, kPatchBall_m, ElasticPace::kVirtual);
  }
  void TearDown() override { std::filesystem::remove(file_); }

  /// One step of physics for this motion.
  Interaction answer(const ToolMotion& motion, int tick) {
    Interaction answer;
    answer.header = {.session_id = 9,
                     .sequence = static_cast<std::uint64_t>(tick),
                     .sampled_at = motion.header.sampled_at};
    answer.steps = static_cast<std::uint64_t>(tick) + 1;
    answer.device_session_id = motion.device_session_id;
    answer.device_sampled_at = motion.device_sampled_at;
    answer.tool_position_world_m = motion.tool_position_world_m;
    answer.surface.store_id = motion.receipts.store_id;
    if (motion.elastic_receipts) {
      tissues_->describe_ahead(0, motion.tool_velocity_world_m_per_s,
                               to_seconds(motion.receipts.loop_age));
    }
    SceneForce force;
    tissues_->step(0, motion.tool_position_world_m, tick * kPatchTick_s, 0.05, force);
    answer.force_on_tool_newton = force.force_on_tool_newton;
    std::copy_n(force.contacts.begin(), force.listed_count, answer.contacts.begin());
    answer.listed_count = force.listed_count;
    answer.contact_count = force.contact_count;
    const TimePoint now = TimePoint{} + from_seconds(tick * kPatchTick_s);
    sender_.fill(*tissues_, 0, motion, now, answer);
    return answer;
  }

  std::string file_ = testing::TempDir() + "elastic_patch_" +
                      testing::UnitTest::GetInstance()->current_test_info()->name() + ".msh";
  std::vector<std::shared_ptr<const ElasticBody>> bodies_;
  std::optional<ElasticTissues> tissues_;
  PatchSender sender_;
};

TEST_F(SentPatch, IsOnlyForAReceiverThatTakesIt) {
  ToolMotion motion;
  motion.tool_position_world_m = {0.0, 0.0, kPatchBall_m};
  motion.receipts.store_id = 3;
  for (int tick = 0; tick < 100; ++tick) {
    EXPECT_EQ(answer(motion, tick).elastic.store_id, 0u);
  }
  motion.elastic_receipts = ElasticReceipts{};
  int sent = 0;
  for (int tick = 100; tick < 200; ++tick) sent += answer(motion, tick).elastic.store_id == 3;
  EXPECT_GT(sent, 0);
}

TEST_F(SentPatch, HasEachTwoPointsInOneMessage) {
  ToolMotion motion;
  motion.tool_position_world_m = {0.0, 0.0, kPatchBall_m - 0.002};
  motion.receipts.store_id = 3;
  motion.elastic_receipts = ElasticReceipts{};
  std::array<ElasticPoint, kElasticSlots> points{};
  ElasticState state;
  for (int tick = 0; tick < 2000; ++tick) {
    const Interaction sent = answer(motion, tick);
    if (sent.elastic.store_id == 0) continue;
    motion.elastic_receipts->newest = sent.elastic.number;
    motion.elastic_receipts->received = ~std::uint64_t{0};
    if (sent.elastic.has_point) {
      points[sent.elastic.point.slot] = sent.elastic.point;
    } else {
      state = sent.elastic.state;
    }
  }
  int listed = 0;
  for (std::size_t i = 0; i < kElasticSlots; ++i) {
    if (state.places[i].version == 0) continue;
    ++listed;
    ASSERT_EQ(points[i].version, state.places[i].version);
    EXPECT_GE(points[i].own[0], 0);
    for (std::size_t k = 0; k < i; ++k) {
      if (state.places[k].version == 0) continue;
      const bool is_newer = points[i].version > points[k].version;
      EXPECT_TRUE(is_newer ? points[i].has_other[k] : points[k].has_other[i]);
    }
  }
  EXPECT_EQ(listed, static_cast<int>(kElasticSlots));
  EXPECT_GT(state.radius_m, kPatchBall_m);
}

/// A press at 150 mm/s, 6 mm deep, 50 ms each way, one message in ten lost: the error of the force
/// against the full solution at every millisecond, relative.
struct Errors {
  double rms = 0.0;
  double first_ratio = 0.0;  // of the largest forces in the first 100 ms
};

TEST_F(SentPatch, MakesADelayedPressRight) {
  constexpr int kDelay = 50;
  const auto errors_of = [&](bool takes_patches) {
    tissues_.emplace(bodies_, 1, kPatchBall_m, ElasticPace::kVirtual);
    sender_ = {};
    ElasticReference reference(bodies_, kPatchBall_m, 2e-3);
    mofc::TissueModel model(true, 100.0, 77);
    Random random(5);
    std::deque<std::pair<int, ToolMotion>> up;
    std::deque<std::pair<int, std::unique_ptr<Interaction>>> down;
    std::optional<ToolMotion> heard;
    std::unique_ptr<Interaction> newest;
    double error2 = 0.0;
    double ideal2 = 0.0;
    double first_newton = 0.0;
    double first_ideal_newton = 0.0;
    int touched = 0;
    for (int tick = 0; tick < 900; ++tick) {
      const double t_s = tick * kPatchTick_s;
      const auto tip = [](double s) {
        return Vector3(0.0, 0.0,
                       kPatchBall_m + std::clamp(0.012 - 0.15 * (s - 0.4), -0.006, 0.012));
      };
      const TimePoint now = TimePoint{} + from_seconds(1.0 + t_s);
      ToolMotion motion;
      motion.header.sampled_at = motion.device_sampled_at = now;
      motion.device_session_id = 5;
      motion.tool_position_world_m = tip(t_s);
      motion.tool_velocity_world_m_per_s = (tip(t_s) - tip(t_s - kPatchTick_s)) / kPatchTick_s;
      motion.receipts = model.receipts();
      if (takes_patches) motion.elastic_receipts = model.elastic_receipts();
      if (!random.chance(0.1)) up.emplace_back(tick + kDelay, motion);
      for (; !up.empty() && up.front().first <= tick; up.pop_front()) heard = up.front().second;
      if (heard) {
        auto sent = std::make_unique<Interaction>(answer(*heard, tick));
        if (!random.chance(0.1)) down.emplace_back(tick + kDelay, std::move(sent));
      }
      DeviceState state;
      state.header = {.session_id = 5, .sampled_at = now};
      state.tool_position_world_m = tip(t_s);
      for (; !down.empty() && down.front().first <= tick; down.pop_front()) {
        newest = std::move(down.front().second);
        model.receive(*newest, state);
      }
      Vector3 force = Vector3::Zero();
      if (newest) {
        force =
            model.step(*newest, state, tip(t_s), motion.tool_velocity_world_m_per_s, kPatchTick_s)
                .force_on_tool_newton;
      }
      SceneForce ideal;
      reference.advance(t_s, tip(t_s), ideal);
      error2 += (force - ideal.force_on_tool_newton).squaredNorm();
      ideal2 += ideal.force_on_tool_newton.squaredNorm();
      if (ideal.force_on_tool_newton.norm() > 0.01 && ++touched <= 100) {
        first_newton = std::max(first_newton, force.norm());
        first_ideal_newton = std::max(first_ideal_newton, ideal.force_on_tool_newton.norm());
      }
    }
    return Errors{.rms = std::sqrt(error2 / ideal2),
                  .first_ratio = first_newton / first_ideal_newton};
  };

  const Errors with = errors_of(true);
  EXPECT_LT(with.rms, 0.2);
  EXPECT_LT(with.first_ratio, 1.2);
  EXPECT_GT(errors_of(false).rms, 2.0 * with.rms);
}

}  // namespace
}  // namespace palpate::physics
