// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/log.h"

#include <chrono>
#include <iterator>
#include <string>

#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

/// An episode ends after this long without a tick of it.
constexpr Duration kQuiet = std::chrono::seconds(1);

}  // namespace

WebLog::Side::Side(WebLog& log, const std::string& name)
    : device(log.line_writer(with_side(name, "device_node"))),
      mofc(log.line_writer(with_side(name, "mofc_node"))),
      physics(log.line_writer(with_side(name, "physics_node"))),
      mofc_name(with_side(name, "mofc_node")) {}

WebLog::WebLog(const Session& session, WebServer& server) : server_(server) {
  for (const palpate::Side& side : session.sides) sides_.emplace_back(*this, side.name);
}

OnEventLine WebLog::line_writer(const std::string& node) {
  return [this, node](spdlog::level::level_enum level, const std::string& text) {
    write(level >= spdlog::level::err    ? LogLevel::kError
          : level == spdlog::level::warn ? LogLevel::kWarning
                                         : LogLevel::kInfo,
          node, text);
  };
}

void WebLog::write(LogLevel level, const std::string& node, const std::string& message) {
  const std::uint64_t at_ns = wall_clock_ns();
  kept_.push_back({at_ns, make_payload(encode_log(at_ns, level, node, message))});
  if (kept_.size() > kMostKept) kept_.pop_front();
  server_.publish(index_of(WebChannel::kLog), at_ns, kept_.back().payload);
}

void WebLog::send_history_to(std::uint64_t client) {
  for (const Line& line : kept_) {
    server_.send_to(client, index_of(WebChannel::kLog), line.at_ns, line.payload);
  }
}

void WebLog::pump(TimePoint now) {
  for (Side& side : sides_) {
    ClampEpisode& clamp = side.clamp;
    if (!clamp.is_under_way || now - clamp.grew_at < kQuiet) continue;
    clamp.is_under_way = false;
    write(LogLevel::kInfo, side.mofc_name,
          "event=clamped_ended ticks=" + std::to_string(clamp.ticks - clamp.ticks_before));
  }
}

void WebLog::note(std::size_t side, const DeviceBatch& batch, TimePoint now) {
  std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side))->device.note(batch, now);
}
void WebLog::note(std::size_t side, const MofcBatch& batch, TimePoint now) {
  Side& its = *std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side));
  its.mofc.note(batch, now);

  ClampEpisode& clamp = its.clamp;
  const std::uint64_t ticks = batch.counters.clamped_ticks;
  if (batch.header.session_id != clamp.session_id) {
    // those before this viewer heard of the node have no known time
    clamp.session_id = batch.header.session_id;
    clamp.ticks = batch.header.sequence == 0 ? 0 : ticks;
  }
  if (ticks <= clamp.ticks) return;  // none, or a late batch
  if (!clamp.is_under_way) {
    clamp.is_under_way = true;
    clamp.ticks_before = clamp.ticks;
    write(LogLevel::kWarning, its.mofc_name, "event=clamped_began");
  }
  clamp.ticks = ticks;
  clamp.grew_at = now;
}
void WebLog::note(std::size_t side, const PhysicsBatch& batch, TimePoint now) {
  std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side))->physics.note(batch, now);
}

}  // namespace palpate::viewer
