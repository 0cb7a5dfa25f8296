// SPDX-License-Identifier: Apache-2.0
#include "tests/support/black_box/black_box.h"

#include <utility>

#include "common/core/time.h"
#include "physics_node/foreign/foreign_engine.h"
#include "physics_node/scene/scene.h"

namespace palpate::test {
namespace {

class SceneBehind final : public sdk::Engine {
 public:
  SceneBehind(const Session& session, Told told, std::function<void(Interaction&)> lie)
      : scene_(session.scene), memory_(scene_.new_memory()), told_(told), lie_(std::move(lie)) {}

  sdk::Answer step(const sdk::Motion& motion) override {
    const physics::SceneForce force =
        scene_.step(memory_, motion.position_m, motion.velocity_m_per_s, motion.time_s,
                    motion.orientation * Vector3::UnitZ());
    last_ = motion;
    const Vector3 told = told_of(force.force_on_tool_newton, motion.position_m);
    sdk::Answer answer{.force_on_tool_newton = told};
    if (told_ != Told::kPoints) return answer;
    for (std::uint32_t i = 0; i < force.listed_count; ++i) {
      const Contact& contact = force.contacts[i];
      answer.contacts.push_back(
          {.normal = contact.normal_world,
           .penetration_m = contact.penetration_m,
           .tissue = contact.tissue,
           .force_on_tool_newton = lie_ ? told : contact.force_on_tool_newton});
    }
    return answer;
  }

  std::optional<sdk::Vector3> force_at(const sdk::Vector3& position_m) override {
    if (told_ != Told::kField) return std::nullopt;
    physics::TissueMemory untouched = scene_.new_memory();
    const physics::SceneForce force = scene_.step(
        untouched, position_m, Vector3::Zero(), last_.time_s, last_.orientation * Vector3::UnitZ());
    return told_of(force.force_on_tool_newton, position_m);
  }

 private:
  /// The force as it is told, of that place, at the time of the last step.
  [[nodiscard]] Vector3 told_of(const Vector3& force_newton, const Vector3& position_m) const {
    Interaction told;
    told.header.sampled_at = time_at(last_.time_s);
    told.tool_position_world_m = position_m;
    told.force_on_tool_newton = force_newton;
    if (lie_) lie_(told);
    return told.force_on_tool_newton.allFinite() ? told.force_on_tool_newton : Vector3::Zero();
  }

  physics::Scene scene_;
  physics::TissueMemory memory_;
  sdk::Motion last_;
  Told told_;
  std::function<void(Interaction&)> lie_;
};

}  // namespace

std::unique_ptr<physics::Engine> black_box(const Session& session, Told told,
                                           std::function<void(Interaction&)> lie) {
  return std::make_unique<physics::ForeignEngine>(
      std::make_unique<SceneBehind>(session, told, std::move(lie)),
      session.side().mofc.interaction == InteractionUse::kLocal);
}

}  // namespace palpate::test
