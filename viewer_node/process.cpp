// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/process.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>

#include "common/core/user/output_file.h"
#include "common/link/plot_sender.h"
#include "common/process/heap_trim.h"
#include "common/process/refused_peers_log.h"
#include "common/process/run_host.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "common/telemetry/csv_writer.h"
#include "viewer_node/audience/relay.h"
#include "viewer_node/feed/status_line.h"
#include "viewer_node/openigtlink/feed.h"
#include "viewer_node/task/hidden_lesions.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {
namespace {

// Longest delay until a stop is noticed and rows are flushed.
constexpr Duration kPumpInterval = std::chrono::milliseconds(50);
constexpr Duration kFarewell = std::chrono::milliseconds(50);  // for clients to receive the last
constexpr Duration kWebPumpInterval =
    std::chrono::milliseconds(20);  // longest delay of a client's request

/// Prints one line per side; on a terminal, over the previous ones and no wider than it: a line
/// that wraps could not be rewritten. False if stdout is closed.
bool print_status(const Session& session, std::span<const TelemetryMirror> mirrors, TimePoint now) {
  const std::size_t terminal = terminal_columns(STDOUT_FILENO);
  const bool is_terminal = terminal > 0;
  const std::size_t columns = is_terminal ? std::min(terminal - 1, kStatusColumns) : kStatusColumns;
  const std::vector<Side>& sides = session.sides;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const std::string name = sides[i].name.empty() ? "" : sides[i].name + ": ";
    const std::size_t left = columns - std::min(columns, columns_of(name));
    const std::string line = fitted(name, columns) + status_line(mirrors[i], now, left);
    if (is_terminal) {
      std::printf("\r\033[K%s%s", line.c_str(), i + 1 < sides.size() ? "\n" : "");
    } else {
      std::printf("%s\n", line.c_str());
    }
  }
  // back to the first line
  if (is_terminal && sides.size() > 1) std::printf("\033[%zuA", sides.size() - 1);
  return std::fflush(stdout) == 0;
}

std::vector<Attachment> telemetry_of(const Session& session, const std::string& relay) {
  if (!relay.empty()) return {connect_to(relay, std::string(kRelayLink))};
  std::vector<Attachment> attachments;
  for (const Side& side : session.sides) {
    attachments.push_back(connect_to(side.links.device_telemetry, "links.device_telemetry"));
    attachments.push_back(connect_to(side.links.mofc_telemetry, "links.mofc_telemetry"));
  }
  attachments.push_back(connect_to(session.physics_telemetry, "links.physics_telemetry"));
  if (session.physics.standby) {
    attachments.push_back(connect_to(session.standby_telemetry, "links.standby_telemetry"));
  }
  attachments.push_back(run_state_of(session, Attachment::Role::kConnect));
  return attachments;
}

/// Throws SetupError if an output is also read, exists or is named twice.
void check_files(const Session& session, const ViewerOptions& options) {
  std::vector<std::string> inputs = files_of(session);
  inputs.push_back(options.web.token_file);
  std::vector<NamedOutput> outputs{{"--record", options.record.file}};
  for (const Side& side : session.sides) {
    if (options.csv_file.empty()) break;
    outputs.push_back({"--csv", csv_file_of(options.csv_file, side.name)});
  }
  check_outputs(outputs, inputs, options.record.may_overwrite);
}

/// Publishes rows for PlotJuggler.
class Plot {
 public:
  Plot(ZmqContext& context, const std::string& endpoint, const TelemetryMirror& mirror)
      : sender_(context, endpoint, "--plotjuggler"), mirror_(mirror) {}

  void show(const TickRow& row) {
    // maps the device's clock to the wall clock, at the first row of each session
    const std::int64_t sampled_ns = row.device.sampled_at.time_since_epoch().count();
    if (row.device_session_id != device_session_id_) {
      device_session_id_ = row.device_session_id;
      offset_ns_ = static_cast<std::int64_t>(wall_clock_ns()) - sampled_ns;
    }
    const MofcCounters& mofc = mirror_.mofc_counters();
    sender_.send(static_cast<std::uint64_t>(sampled_ns + offset_ns_), row.device, row.mofc,
                 mofc.transparency());
  }
  [[nodiscard]] const std::string& endpoint() const { return sender_.endpoint(); }

 private:
  PlotSender sender_;
  const TelemetryMirror& mirror_;
  std::uint64_t device_session_id_ = 0;
  std::int64_t offset_ns_ = 0;
};

}  // namespace

TelemetryFeed::TelemetryFeed(const Session& session, const Clock& clock, ProcessLinks& links,
                             const std::string& relay)
    : sides_(session), subscriber_(links.side, clock, telemetry_of(session, relay)) {}

void TelemetryFeed::pump(std::span<TelemetryMirror> mirrors, TimePoint deadline) {
  subscriber_.wait_until(deadline);
  TimePoint received_at;
  while (subscriber_.receive(message_, received_at)) {
    if (on_message) on_message(message_, subscriber_.payload());
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { message.side; }) {
            if (const auto side = sides_.of(message.side)) {
              mirrors[*side].take(message, received_at);
            }
          }
        },
        message_);
  }
}

void run_process(NodeContext& context, ProcessLinks& links, const ViewerOptions& options) {
  const std::vector<Side>& sides = context.session.sides;
  check_files(context.session, options);
  std::vector<TelemetryMirror> mirrors(sides.size());
  std::vector<std::unique_ptr<CsvWriter>> csvs;
  std::optional<Plot> plot;
  if (!options.plotjuggler.empty()) {
    plot.emplace(links.side, options.plotjuggler, mirrors.front());
    context.log.info("event=plotjuggler endpoint={} schema=proto/palpate/v1/plot.proto",
                     plot->endpoint());
  }
  std::optional<TaskView> task;
  const bool has_web = options.web.is_enabled(context.session.viewer.web);
  if (context.session.task) {
    task.emplace(context.session, has_web ? std::make_unique<TaskJournal>(
                                                run_folder(context.session.name) / "task.journal")
                                          : nullptr);
  }
  HiddenLesions hidden(context.session);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    CsvWriter* csv = nullptr;
    if (!options.csv_file.empty()) {
      const std::string file = csv_file_of(options.csv_file, sides[i].name);
      csv =
          csvs.emplace_back(std::make_unique<CsvWriter>(file, options.record.may_overwrite)).get();
    }
    Plot* shown = i == 0 && plot ? &*plot : nullptr;
    if (csv == nullptr && shown == nullptr && !task) continue;
    mirrors[i].on_row = [csv, shown, &task](const TickRow& row) {
      if (task) task->take(row);
      if (csv != nullptr) csv->write(row);
      if (shown != nullptr) shown->show(row);
    };
  }
  const auto check_csv = [&] {
    for (const auto& csv : csvs) {
      if (const auto error = csv->take_error()) throw std::runtime_error(*error);
    }
  };

  TelemetryFeed feed(context.session, context.clock, links, options.follow);
  std::optional<Relay> relay;
  if (!options.publish.empty()) {
    relay.emplace(links.side, options.publish, feed.subscriber());
    context.log.info("event=relay endpoint={}", relay->endpoint());
  }
  bool has_lost_recording = false;
  std::optional<Recording> recording;
  if (!options.record.file.empty()) {
    recording.emplace(options.record, context.session, "viewer_node", feed.subscriber());
  }
  const auto check_recording = [&] {  // the viewer continues without it
    if (!recording) return;
    if (const auto error = recording->take_error()) {
      context.log.error("event=recording_failed what=\"{}\"", *error);
      has_lost_recording = true;
    }
  };
  std::optional<WebFeed> web;
  if (has_web) {
    web.emplace(context, links, options.web, feed.subscriber(), mirrors, task ? &*task : nullptr);
  }
  std::optional<IgtlFeed> igtl;
  if (options.openigtlink) {
    igtl.emplace(context, *options.openigtlink, feed.subscriber(), mirrors);
  }
  const auto pass_on = [&](const std::optional<HiddenLesions::Passed>& passed) {
    if (!passed) return;
    if (relay) relay->take(*passed->message, passed->payload);
    if (web) web->take(*passed->message, passed->payload);
    if (igtl) igtl->take(*passed->message);
  };
  feed.on_message = [&](const TelemetryMessage& message, std::span<const std::byte> payload) {
    if (recording) recording->take(message, payload);
    if (task) task->take(message);
    pass_on(hidden.pass(message, payload));
  };
  if (task) feed.subscriber().subscribe<SceneState>();
  RefusedPeersLog refused_peers(context.log, links.side.refused());
  HeapTrim heap;
  bool is_quiet = options.is_quiet;
  TimePoint next_status = context.clock.now() + context.session.viewer.status_interval;
  while (!context.stop.stop_requested()) {
    const Duration interval = web || relay ? kWebPumpInterval : kPumpInterval;
    TimePoint deadline = std::min(context.clock.now() + interval, next_status);
    if (igtl) deadline = std::min(deadline, igtl->due());
    feed.pump(mirrors, deadline);
    const TimePoint now = context.clock.now();
    if (task && task->may_reveal()) pass_on(hidden.reveal());
    if (igtl) igtl->pump(now);
    if (relay) relay->pump();
    if (web) web->pump(now);
    refused_peers.note(now);
    heap.note(now);
    if (now < next_status) continue;
    next_status = now + context.session.viewer.status_interval;
    if (!is_quiet) is_quiet = !print_status(context.session, mirrors, now);
    for (const auto& csv : csvs) csv->flush();
    check_csv();
    check_recording();
  }
  if (web) {
    web->end();
    feed.pump(mirrors, context.clock.now() + kFarewell);
  }
  for (TelemetryMirror& mirror : mirrors) mirror.flush_rows();
  for (const auto& csv : csvs) csv->close();
  check_csv();
  if (recording) recording->close();
  check_recording();
  if (!is_quiet) std::printf("%s", std::string(sides.size(), '\n').c_str());
  if (has_lost_recording)
    throw std::runtime_error("the recording is incomplete; see the error above");
}

}  // namespace palpate::viewer
