// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/physics/process.h"

#include <chrono>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "deploy/ros/physics/ros_engine.h"
#include "physics_node/engine_process/process.h"
#include "physics_node/foreign/foreign_display.h"

namespace palpate::ros {
namespace {

constexpr Duration kReportInterval = std::chrono::milliseconds(200);

void log_end(spdlog::logger& log, const std::string& topics, const WrenchCounts& counts) {
  const auto us = [](Duration d) { return static_cast<double>(d.count()) * 1e-3; };
  const std::uint64_t refused =
      std::accumulate(counts.refused.begin(), counts.refused.end(), std::uint64_t{0});
  log.info(
      "event=ros_physics topics={} poses={} poses_left_out={} forces={} refused={} "
      "round_trips={} round_trip_p50_us={:.0f} round_trip_p99_us={:.0f} transit_p50_us={:.0f} "
      "transit_p99_us={:.0f}",
      topics, counts.poses, counts.poses_left_out, counts.taken, refused, counts.round_trip.count(),
      us(counts.round_trip.quantile(0.5)), us(counts.round_trip.quantile(0.99)),
      us(counts.transit.quantile(0.5)), us(counts.transit.quantile(0.99)));
}

}  // namespace

void run_ros_physics(NodeContext& context, ProcessLinks& links, const RosPhysicsOptions& options) {
  const Session& session = context.session;
  if (session.sides.size() > 1 && options.force_topic.starts_with('/')) {
    throw SetupError("--force-topic = " + options.force_topic +
                     ": of several sides each has its own; leave out the leading /");
  }
  Node node(options.network);
  struct Tool {
    std::string topics;
    RosEngine* engine = nullptr;  // of run_process
    WrenchCounts counts{};        // before it was gone
  };
  std::vector<Tool> tools;
  const auto moved = std::make_shared<physics::MovedSurfaces>();
  const std::vector<sdk::Surface> no_surfaces;
  TimePoint next_report{};
  physics::run_process(context, links,
                       {.make_engine =
                            [&](const Side& side) {
                              const std::string topics =
                                  options.name_space + (side.name.empty() ? "" : "/" + side.name);
                              const std::string forces = options.force_topic.starts_with('/')
                                                             ? options.force_topic.substr(1)
                                                             : topics + "/" + options.force_topic;
                              auto engine = std::make_unique<RosEngine>(
                                  node, context.clock, topics + "/servo_cp", forces, options.offer,
                                  options.wrench, side.mofc.interaction == InteractionUse::kLocal);
                              tools.push_back({.topics = topics, .engine = engine.get()});
                              context.log.info("event=ros {} out={}/servo_cp in={}",
                                               text_of(options.network), topics, forces);
                              return engine;
                            },
                        .make_display =
                            [&](Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out) {
                              return std::make_unique<physics::ForeignDisplay>(
                                  session, context.session_id, no_surfaces, moved, scene_out,
                                  mesh_out);
                            },
                        .on_pump =
                            [&](TimePoint now) {
                              if (now < next_report) return;
                              next_report = now + kReportInterval;
                              node.note_strangers([&](const char* event, const std::string& line) {
                                context.log.warn("event={} what=\"{}\"", event, line);
                              });
                              for (Tool& tool : tools) {
                                tool.engine->report(now, context.log);
                                tool.counts = tool.engine->counts();
                              }
                            }});
  for (const Tool& tool : tools) log_end(context.log, tool.topics, tool.counts);
}

}  // namespace palpate::ros
