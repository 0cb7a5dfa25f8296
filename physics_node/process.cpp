// SPDX-License-Identifier: Apache-2.0
#include "physics_node/process.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/link/zmq_source.h"
#include "common/process/rejection_log.h"
#include "common/session/session_file.h"
#include "physics_node/display/scene_display.h"
#include "physics_node/elastic_tissue/scene_report.h"
#include "physics_node/engine_process/process.h"
#include "physics_node/scene_engine.h"
#include "physics_node/tissue_changes.h"

namespace palpate::physics {
namespace {

/// Hop 8.
class Control {
 public:
  Control(const Session& session, NodeContext& context, ZmqContext& side)
      : log_(context.log),
        source_(side, context.clock, bind_to(session.tissue_change, "viewer.control")),
        refused_(context.log, "tissue_change", source_.rejections()),
        changes_(session.scene, source_),
        tissues_(session.scene.tissues) {}

  /// On the publisher's thread.
  void pump(SceneDisplay& display, TimePoint now) {
    changes_.receive([&](const TissueChange& change) {
      if (change.restores) return;  // the display sees the body that is shown
      display.set_material(change.tissue, change.stiffness_newton_per_m,
                           change.damping_newton_s_per_m);
      log_.info(
          "event=tissue_changed tissue=\"{}\" stiffness_newton_per_m={} "
          "damping_newton_s_per_m={}",
          tissues_[change.tissue].name, change.stiffness_newton_per_m,
          change.damping_newton_s_per_m);
    });
    refused_.note(now);
  }
  /// On the thread of the steps, between two of them. Real-time safe.
  void apply(Scene& scene, ElasticTissues* elastic,
             const std::vector<SceneEngine*>& engines) noexcept {
    TissueChange change;
    while (changes_.next(change)) {
      if (change.restores) {
        if (elastic != nullptr) elastic->restore(change.tissue);
        continue;
      }
      scene.set_material(change.tissue, change.stiffness_newton_per_m,
                         change.damping_newton_s_per_m);
      for (SceneEngine* engine : engines) engine->note_changed(change.tissue);
    }
  }
  void count_into(PhysicsCounters& counters) const { changes_.count_into(counters); }

 private:
  spdlog::logger& log_;
  ZmqSource<TissueChange> source_;
  RejectionLog refused_;
  TissueChanges changes_;
  const std::vector<TissueConfig>& tissues_;
};

/// Where no other user can put anything; empty: nowhere, so that nothing is kept.
std::filesystem::path own_cache_folder(const SceneConfig& scene, spdlog::logger& log) {
  const bool is_any_elastic =
      std::any_of(scene.tissues.begin(), scene.tissues.end(), [](const TissueConfig& tissue) {
        return std::holds_alternative<ElasticMaterial>(tissue.material);
      });
  std::filesystem::path folder = cache_folder();
  if (!is_any_elastic || folder.empty()) return {};
  const std::string why = make_private_folder(folder);
  if (why.empty()) return folder;
  log.warn("event=cache_not_used reason=\"{}\"", why);
  return {};
}

void warn_of_tearing(const ElasticTissues& elastic, const SceneConfig& scene, spdlog::logger& log) {
  for (const auto& one : elastic.tissues()) {
    const TissueConfig& tissue = scene.tissues[one->body().tissue];
    for (const std::string& warning :
         tearing_warnings(one->body(), std::get<ElasticMaterial>(tissue.material))) {
      log.warn("event=tears_too_hard tissue=\"{}\" reason=\"{}\"", tissue.name, warning);
    }
  }
}

}  // namespace

void run_process(NodeContext& context, ProcessLinks& links, PhysicsRole role) {
  const Session& session = context.session;
  if (role == PhysicsRole::kStandby && !session.physics.standby) {
    throw SetupError(
        session.file +
        ": --standby: the session has no physics.standby; give physics { standby {} }, "
        "or leave --standby out");
  }
  if (!session.physics_command.empty()) {
    throw SetupError(session.file +
                     ": physics.command names another program as the physics of this session; "
                     "start it with `palpate launch`, or take the field out");
  }
  const double reach_m = reach_of(session);
  const auto scene = std::make_shared<Scene>(session.scene, reach_m);
  const std::shared_ptr<ElasticTissues> elastic =
      ElasticTissues::of(session.scene, session.sides.size(), ElasticPace::kThread,
                         own_cache_folder(session.scene, context.log));
  if (elastic) warn_of_tearing(*elastic, session.scene, context.log);
  std::vector<SceneEngine*> engines;
  SceneDisplay* display = nullptr;
  PhysicsProgram program{.make_engine =
                             [&](const Side& side) {
                               auto engine = std::make_unique<SceneEngine>(
                                   scene, session.physics.rate_hz, side.mofc.interaction, reach_m,
                                   elastic, engines.size());
                               engines.push_back(engine.get());
                               return engine;
                             },
                         .make_display =
                             [&](Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out) {
                               auto made = std::make_unique<SceneDisplay>(
                                   session, context.session_id, scene_out, mesh_out, elastic);
                               display = made.get();
                               return made;
                             }};
  program.role = role;
  std::optional<Control> control;
  if (may_change_tissue(session)) {
    control.emplace(session, context, links.side);
    program.on_pump = [&](TimePoint now) { control->pump(*display, now); };
    program.before_step = [&] { control->apply(*scene, elastic.get(), engines); };
    program.count_into = [&](PhysicsCounters& counts) { control->count_into(counts); };
  }
  run_process(context, links, program);
}

}  // namespace palpate::physics
