#include "viewer_node/process.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>
#include <stdexcept>

#include "common/core/regular_file.h"
#include "common/link/plot_sender.h"
#include "common/runtime/refused_peers_log.h"
#include "viewer_node/csv_writer.h"
#include "viewer_node/status_line.h"

namespace palpate::viewer {
namespace {

// How soon a stop is noticed, and how often a CSV reader sees new rows.
constexpr Duration kPumpInterval = std::chrono::milliseconds(50);
constexpr Duration kWebPumpInterval = std::chrono::milliseconds(20);  // clients wait so long

/// False if nobody can read it any more.
bool print_status(const TelemetryMirror& mirror, TimePoint now) {
  const bool is_terminal = isatty(STDOUT_FILENO) == 1;
  std::printf(is_terminal ? "\r\033[K%s" : "%s\n", status_line(mirror, now).c_str());
  return std::fflush(stdout) == 0;
}

/// Rows as PlotJuggler takes them.
class Plot {
 public:
  Plot(ZmqContext& context, const std::string& endpoint, const TelemetryMirror& mirror)
      : sender_(context, endpoint, "--plotjuggler"), mirror_(mirror) {}

  void show(const TickRow& row) {
    // device's clock on that of the wall, as its session began to be heard
    const std::int64_t sampled_ns = row.device.sampled_at.time_since_epoch().count();
    if (row.device_session_id != device_session_id_) {
      device_session_id_ = row.device_session_id;
      offset_ns_ = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count() -
                   sampled_ns;
    }
    const MofcCounters& mofc = mirror_.mofc_counters();
    sender_.send(static_cast<std::uint64_t>(sampled_ns + offset_ns_), row.device, row.mofc,
                 mofc.transparency_samples > 0
                     ? mofc.transparency_sum / static_cast<double>(mofc.transparency_samples)
                     : kNaN);
  }
  [[nodiscard]] const std::string& endpoint() const { return sender_.endpoint(); }

 private:
  PlotSender sender_;
  const TelemetryMirror& mirror_;
  std::uint64_t device_session_id_ = 0;
  std::int64_t offset_ns_ = 0;
};

}  // namespace

TelemetryFeed::TelemetryFeed(const LinksConfig& config, const Clock& clock, ProcessLinks& links)
    : clock_(clock),
      subscriber_(links.side, clock,
                  {connect_to(config.device_telemetry, "links.device_telemetry"),
                   connect_to(config.mofc_telemetry, "links.mofc_telemetry"),
                   connect_to(config.physics_telemetry, "links.physics_telemetry")}) {}

void TelemetryFeed::pump(TelemetryMirror& mirror, TimePoint deadline) {
  subscriber_.wait_until(deadline);
  TimePoint received_at;
  while (subscriber_.receive(message_, received_at)) {
    if (on_message) on_message(message_, subscriber_.payload());
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { mirror.take(message, received_at); }) {
            mirror.take(message, received_at);
          }
        },
        message_);
  }
}

void run_process(NodeContext& context, ProcessLinks& links, const ViewerOptions& options) {
  refuse_shared_file({{"--csv", options.csv_file}, {"--record", options.record.file}});
  TelemetryMirror mirror;
  std::optional<CsvWriter> csv;
  if (!options.csv_file.empty()) csv.emplace(options.csv_file);
  std::optional<Plot> plot;
  if (!options.plotjuggler.empty()) {
    plot.emplace(links.side, options.plotjuggler, mirror);
    context.log.info("event=plotjuggler endpoint={} schema=proto/palpate/v1/plot.proto",
                     plot->endpoint());
  }
  if (csv || plot) {
    mirror.on_row = [&](const TickRow& row) {
      if (csv) csv->write(row);
      if (plot) plot->show(row);
    };
  }
  const auto check_csv = [&] {
    if (!csv) return;
    if (const auto error = csv->take_error()) throw std::runtime_error(*error);
  };

  TelemetryFeed feed(context.session.links, context.clock, links);
  bool has_lost_recording = false;
  std::optional<Recording> recording;
  if (!options.record.file.empty()) {
    recording.emplace(options.record, context.session, "viewer_node", feed.subscriber());
  }
  const auto check_recording = [&] {  // goes on without it
    if (!recording) return;
    if (const auto error = recording->take_error()) {
      context.log.error("event=recording_failed what=\"{}\"", *error);
      has_lost_recording = true;
    }
  };
  std::optional<WebFeed> web;
  if (options.web.is_asked_for(context.session.viewer.web)) {
    web.emplace(context, links, options.web, feed.subscriber(), mirror);
  }
  feed.on_message = [&](const TelemetryMessage& message, std::span<const std::byte> payload) {
    if (recording) recording->take(message, payload);
    if (web) web->take(message, payload);
  };
  RefusedPeersLog refused_peers(context.log, links.side.refused());
  bool is_quiet = options.is_quiet;
  TimePoint next_status = context.clock.now() + context.session.viewer.status_interval;
  while (!context.stop.stop_requested()) {
    const Duration interval = web ? kWebPumpInterval : kPumpInterval;
    feed.pump(mirror, std::min(context.clock.now() + interval, next_status));
    const TimePoint now = context.clock.now();
    if (web) web->pump(now);
    refused_peers.note(now);
    if (now < next_status) continue;
    next_status = now + context.session.viewer.status_interval;
    if (!is_quiet) is_quiet = !print_status(mirror, now);
    if (csv) csv->flush();
    check_csv();
    check_recording();
  }
  mirror.flush_rows();
  if (csv) csv->close();
  check_csv();
  if (recording) recording->close();
  check_recording();
  if (!is_quiet) std::printf("\n");
  if (has_lost_recording) throw std::runtime_error("the recording is not whole; see above");
}

}  // namespace palpate::viewer
