#include "viewer_node/web_log.h"

#include <iterator>

#include "viewer_node/web_channels.h"

namespace palpate::viewer {

WebLog::Side::Side(WebLog& log, const std::string& name)
    : device(log.line_writer(with_side(name, "device_node"))),
      mofc(log.line_writer(with_side(name, "mofc_node"))),
      physics(log.line_writer(with_side(name, "physics_node"))) {}

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
  const std::size_t channel = index_of(WebChannel::kLog);
  if (!server_.has_subscriber(channel)) return;
  const std::uint64_t at_ns = wall_clock_ns();
  server_.publish(channel, at_ns, make_payload(encode_log(at_ns, level, node, message)));
}

void WebLog::note(std::size_t side, const DeviceBatch& batch, TimePoint now) {
  std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side))->device.note(batch, now);
}
void WebLog::note(std::size_t side, const MofcBatch& batch, TimePoint now) {
  std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side))->mofc.note(batch, now);
}
void WebLog::note(std::size_t side, const PhysicsBatch& batch, TimePoint now) {
  std::next(sides_.begin(), static_cast<std::ptrdiff_t>(side))->physics.note(batch, now);
}

}  // namespace palpate::viewer
