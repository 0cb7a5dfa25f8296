// SPDX-License-Identifier: Apache-2.0
// The tissue library gives the force of the session: of every shipped session in lockstep, at the
// same motion, to the bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "physics_node/library/palpate_tissue.hpp"
#include "physics_node/scene_engine.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

struct Moment {
  ToolMotion motion;
  double time_s = 0.0;  // of the tissue
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;
};
using Moments = std::vector<Moment>;

/// The engine of a session, which notes what it is asked and what it answers.
class NotingEngine final : public physics::Engine {
 public:
  NotingEngine(const Session& session, std::shared_ptr<Moments> moments)
      : engine_(session.scene, session.physics, session.side().mofc.interaction),
        moments_(std::move(moments)) {}
  bool step(const ToolMotion& motion, bool is_new, TimePoint now,
            Interaction& answer) noexcept override {
    const bool has_answer = engine_.step(motion, is_new, now, answer);
    moments_->push_back({.motion = motion,
                         .time_s = seconds_of(now + answer.scene_ahead),
                         .force_on_tool_newton = answer.force_on_tool_newton,
                         .stored_energy_joule = answer.stored_energy_joule});
    return has_answer;
  }

 private:
  physics::SceneEngine engine_;
  std::shared_ptr<Moments> moments_;
};

std::vector<std::string> shipped_sessions() {
  std::vector<std::string> files;
  for (const char* const folder : {"/deploy/sessions", "/deploy/sessions/tasks"}) {
    for (const auto& entry : std::filesystem::directory_iterator(test::source_dir() + folder)) {
      if (entry.path().extension() == ".txtpb") files.push_back(entry.path().string());
    }
  }
  files.push_back(test::source_dir() + "/deploy/sessions/tools/gallbladder_on_liver.txtpb");
  std::sort(files.begin(), files.end());
  return files;
}

bool is_elastic(const Session& session) {
  return std::any_of(session.scene.tissues.begin(), session.scene.tissues.end(),
                     [](const TissueConfig& tissue) {
                       return std::holds_alternative<ElasticMaterial>(tissue.material);
                     });
}

class SessionForce : public testing::TestWithParam<std::string> {};

TEST_P(SessionForce, IsThatOfTheLibraryToTheBit) {
  const std::string& file = GetParam();
  Session session = load_session(file);
  ASSERT_TRUE(session.sides.size() == 1 || !is_elastic(session))
      << "tools that meet in a body have to make their steps together here";
  const auto& gripper = session.scene.gripper;
  // there mofc_node decides when the jaws lose the tissue, here physics does
  if (session.name == "hostile_grasp") GTEST_SKIP() << "the hand tears what it holds";
  const Duration end = from_seconds(gripper ? 2.2 : is_elastic(session) ? 0.8 : 17.0);

  // as it runs, and with an engine for each tool that notes what it does
  std::vector<PhysicsTick> ticks;
  LockstepOptions options;
  options.on_physics_tick = [&](const PhysicsTick& tick) { ticks.push_back(tick); };
  Lockstep(session, options, {}).run_until(end);
  std::vector<std::shared_ptr<Moments>> tools;
  LockstepOptions noting;
  noting.make_engine = [&](const Session& of) -> std::unique_ptr<physics::Engine> {
    tools.push_back(std::make_shared<Moments>());
    return std::make_unique<NotingEngine>(of, tools.back());
  };
  Lockstep(session, noting, {}).run_until(end);
  ASSERT_FALSE(tools.empty());
  ASSERT_EQ(tools.front()->size(), ticks.size());
  std::size_t touched = 0;
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    ASSERT_EQ((*tools.front())[k].force_on_tool_newton, ticks[k].force_on_tool_newton) << k;
    touched += ticks[k].contact_count > 0 ? 1U : 0U;
  }
  EXPECT_GT(touched, 5U) << "this says nothing";

  const tissue::Scene scene = tissue::Scene::load(file);
  for (const std::shared_ptr<Moments>& moments : tools) {
    tissue::Batch batch(scene);
    double before_s = moments->front().time_s - 1e-3;
    batch.reset(0, before_s);
    for (std::size_t k = 0; k < moments->size(); ++k) {
      const Moment& moment = (*moments)[k];
      palpate_tool& tool = batch.tool();
      const Quaternion& q = moment.motion.tool_orientation_world;
      for (int i = 0; i < 3; ++i) {
        tool.position_m[i] = moment.motion.tool_position_world_m[i];
        tool.velocity_m_per_s[i] = moment.motion.tool_velocity_world_m_per_s[i];
      }
      tool.is_velocity_known = 1;
      tool.orientation_wxyz[0] = q.w();
      tool.orientation_wxyz[1] = q.x();
      tool.orientation_wxyz[2] = q.y();
      tool.orientation_wxyz[3] = q.z();
      tool.are_jaws_closed =
          gripper && (moment.motion.buttons >> gripper->button & 1U) != 0 ? 1 : 0;
      batch.step(moment.time_s - before_s);
      before_s = moment.time_s;
      ASSERT_EQ(batch.time_s(), moment.time_s) << k;
      const palpate_tool_force& force = batch.force();
      ASSERT_EQ(Vector3(force.force_on_tool_newton[0], force.force_on_tool_newton[1],
                        force.force_on_tool_newton[2]),
                moment.force_on_tool_newton)
          << "step " << k;
      ASSERT_EQ(force.stored_energy_joule, moment.stored_energy_joule) << "step " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shipped, SessionForce, testing::ValuesIn(shipped_sessions()),
                         [](const auto& info) {
                           return std::filesystem::path(info.param).stem().string();
                         });

}  // namespace
}  // namespace palpate
