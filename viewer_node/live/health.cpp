// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/health.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/core/user/utf8.h"
#include "common/core/version.h"
#include "common/telemetry/verdict/verdict.h"
#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

constexpr Duration kInterval = std::chrono::milliseconds(200);
constexpr Duration kHeardWithin = std::chrono::seconds(1);

}  // namespace

WebHealth::WebHealth(const Session& session, std::span<const TelemetryMirror> mirrors,
                     const TelemetrySubscriber& subscriber, WebServer& server, WebLog& log)
    : session_(session),
      mirrors_(mirrors),
      subscriber_(subscriber),
      server_(server),
      log_(log),
      metrics_(session),
      figures_(session.sides.size()) {}

void WebHealth::pump(TimePoint now, const std::function<ViewerHealth()>& own) {
  if (now < next_) return;
  next_ = now + kInterval;

  const WebServer::Counters counters = server_.counters();
  ViewerHealth health = own();
  health.clients = counters.clients;
  health.messages_dropped = counters.dropped;
  health.frames_rejected = subscriber_.rejected();
  health.version = version();
  const std::vector<Side>& sides = session_.sides;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    add_node(health, with_side(sides[i].name, "device"), mirrors_[i].device_link(), now);
    add_node(health, with_side(sides[i].name, "mofc"), mirrors_[i].mofc_link(), now);
    add_node(health, with_side(sides[i].name, "physics"), mirrors_[i].physics_link(), now);
    if (sides.size() > 1) add_state(health.sides.at(i), sides[i], mirrors_[i]);
  }
  server_.set_metrics(metrics_.text(mirrors_,
                                    {.clients = counters.clients,
                                     .messages_dropped = counters.dropped,
                                     .messages_thinned = counters.thinned,
                                     .requests_refused = counters.refused,
                                     .frames_rejected = subscriber_.rejected()},
                                    now));
  if (health.run.replay && !first_run_) first_run_ = health.run.replay->runs;
  const bool is_replay = health.run.replay.has_value();
  other_runs_ =
      is_replay ? health.run.replay->runs - std::min(*first_run_, health.run.replay->runs) : 0;
  server_.set_verdict(verdicts());
  const std::size_t channel = index_of(WebChannel::kHealth);
  if (server_.has_subscriber(channel)) {
    server_.publish(channel, wall_clock_ns(), make_payload(encode_health(health)));
  }
}

std::vector<RunFinding> WebHealth::verdict_of(std::size_t side) const {
  RunFacts facts =
      facts_of(facts_of(session_, session_.sides[side]), mirrors_[side], figures_[side]);
  facts.ticks_received = 0;  // rows are not counted here
  leave_out_runs(facts, other_runs_);
  return judge(facts);
}

std::string WebHealth::verdicts() const {
  nlohmann::ordered_json json;
  json["session"] = session_.name;
  for (std::size_t i = 0; i < figures_.size(); ++i) {
    json["sides"][session_.sides[i].name] = verdict_json(verdict_of(i));
  }
  return json_text(json) + "\n";
}

void WebHealth::tell_verdicts() {
  for (std::size_t i = 0; i < figures_.size(); ++i) {
    if (!mirrors_[i].device_link().is_heard()) continue;
    const std::vector<RunFinding> findings = verdict_of(i);
    const Grade grade = grade_of(findings);
    std::string text;
    for (const RunFinding& finding : findings) {
      if (finding.grade != grade || grade == Grade::kGood) continue;
      text += (text.empty() ? "" : "; ") + finding.text;
    }
    std::replace(text.begin(), text.end(), '"', '\'');
    const std::string& side = session_.sides[i].name;
    log_.write(grade == Grade::kGood ? LogLevel::kInfo : LogLevel::kWarning, "viewer_node",
               fmt::format("event=verdict {}grade={} text=\"{}\"",
                           side.empty() ? "" : "side=" + side + " ", name(grade), text));
  }
}

void WebHealth::add_state(ViewerHealth::Side& state, const Side& side,
                          const TelemetryMirror& mirror) {
  const DeviceCounters& counters = mirror.device_counters();
  state.name = side.name;
  state.device_session_id = mirror.device_session_id();
  state.phase = counters.phase;
  state.device_faults = counters.device_faults;
  state.last_fault = counters.last_fault;
  const TelemetryMirror::JoinedTick* const newest = mirror.newest_of_device();
  if (newest != nullptr) state.device = newest->device;
  const TelemetryMirror::JoinedTick* const joined = mirror.newest_joined();
  if (joined != nullptr) {
    state.requested_force_newton = joined->mofc->requested_force_on_hand_newton;
  }
  state.pointer = side.hand.pointer;
  state.workspace_scale_ratio = side.device.workspace.scale_ratio;
}

void WebHealth::add_node(ViewerHealth& health, const std::string& name, const NodeLink& link,
                         TimePoint now) {
  const bool is_heard = link.is_heard() && now - link.heard_at <= kHeardWithin;
  health.nodes.push_back({.name = name,
                          .is_heard = is_heard,
                          .silence_s = link.is_heard() ? to_seconds(now - link.heard_at) : -1.0,
                          .sessions = link.sessions,
                          .batches_lost = link.batches_lost,
                          .records_lost = link.records_lost});
  // a replay stands still and begins anew as viewers like; its nodes are not silent then
  if (!health.run.replay) note_node(name, is_heard, link.sessions);
}

void WebHealth::note_node(const std::string& name, bool is_heard, std::uint64_t sessions) {
  const auto write = [&](LogLevel level, const char* event) {
    log_.write(level, "viewer_node", std::string("event=") + event + " node=" + name + "_node");
  };
  const Seen before = std::exchange(seen_[name], {is_heard, sessions});
  if (before.sessions > 0 && sessions > before.sessions) {
    write(LogLevel::kWarning, "node_restarted");
  }
  if (is_heard == before.is_heard) return;
  write(is_heard ? LogLevel::kInfo : LogLevel::kWarning, is_heard ? "node_heard" : "node_silent");
}

}  // namespace palpate::viewer
