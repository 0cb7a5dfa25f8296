// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/link/socket/endpoint.h"
#include "common/process/blocked_signals.h"
#include "common/process/heap_trim.h"
#include "common/process/options.h"
#include "common/process/realtime.h"
#include "common/process/run_host.h"
#include "common/process/run_node.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "common/task/evaluator.h"
#include "common/telemetry/csv_writer.h"
#include "deploy/launch/launch.h"
#include "deploy/launch/trust.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/launch/launch_figures.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/screen/page.h"
#include "deploy/palpate/screen/verdict.h"
#include "viewer_node/process.h"

namespace palpate {
namespace {

struct LaunchCommand {
  SessionOptions session;
  std::optional<double> seconds;
  OutputOptions output;
  bool has_no_realtime = false;
  bool is_insecure = false;
  bool is_unsafe = false;
  bool has_no_adversary = false;
  bool is_trusted = false;
  /// Run on this machine.
  std::set<std::string> nodes = {"device", "mofc", "physics", "standby", "viewer"};
  bool are_chosen = false;  ///< by --nodes
  bool is_together = false;
  bool is_emulated = false;
  bool ends_with_task = false;
  bool is_blind = false;

  void add_to(CLI::App& app);
  /// The session has a standby that --nodes names or whose links do not leave this machine.
  [[nodiscard]] bool has_standby_here(const Session& session) const;
  /// Runs until the time is up or a signal arrives. If the session has keys and this machine lacks
  /// the viewer's, the run has no figures. Throws SetupError.
  /// @return exit status
  [[nodiscard]] int run(const Verbosity& verbosity) const;
};

void LaunchCommand::add_to(CLI::App& app) {
  session.add_to(app);
  add_seconds_option(app, seconds, "stop after this time in s (default: run until Ctrl-C)");
  output.add_to(app, "; with several sides one file each, run.SIDE.csv");
  add_no_realtime_flag(app, has_no_realtime);
  add_insecure_flag(app, is_insecure);
  add_unsafe_flag(app, is_unsafe);
  add_no_adversary_flag(app, has_no_adversary);
  add_trust_flag(app, is_trusted);
  const auto take_together = [this](const std::vector<std::string>& given) {
    const std::set<std::string> names(given.begin(), given.end());
    is_together = names == std::set<std::string>{"device", "mofc"} && given.size() == 2;
    if (is_together) return;
    throw CLI::ValidationError("--together",
                               "only device and mofc can share a process; give device,mofc");
  };
  app.add_option_function<std::vector<std::string>>(
         "--together", take_together,
         "run device and mofc in one process and one thread: fast enough for 4 kHz")
      ->type_name("NODE,NODE:{device,mofc}")
      ->delimiter(',')
      ->allow_extra_args(false);
  CLI::Option* const chosen =
      app.add_option("--nodes", nodes, "run only these nodes here, the others on other machines")
          ->type_name("NODE,…")
          ->delimiter(',')
          ->allow_extra_args(false)
          ->check(CLI::IsMember(nodes))
          ->each([this](const std::string&) { are_chosen = true; });
  app.add_flag("--emulate", is_emulated,
               "start a stand-in for the session's real device, too: palpate emulate");
  app.add_flag("--until-task-ends", ends_with_task,
               "stop 2 s after the task of the session has ended");
  app.add_flag("--blind", is_blind,
               "print the page and the score only, nothing that tells of controller or network");
  app.add_flag_callback(
         "--no-viewer", [this] { nodes.erase("viewer"); },
         "do not start viewer_node: no page, no status line")
      ->excludes(chosen);
}

/// A person at a terminal, whatever it can do, wants figures; files, services and -v get every
/// event.
bool has_short_log(const Verbosity& verbosity) {
  return verbosity.is_quiet || (!verbosity.is_verbose && isatty(STDERR_FILENO) == 1);
}

constexpr Duration kScoreShown = std::chrono::seconds(2);

/// One for each side, or none.
std::vector<std::string> tables_of(const Session& session, const OutputOptions& output) {
  std::vector<std::string> tables;
  if (output.csv_file.empty()) return tables;
  for (const Side& side : session.sides) tables.push_back(csv_file_of(output.csv_file, side.name));
  return tables;
}

/// `palpate launch` as a viewer of its own run, and its markers: figures, tables and the recording.
class RunObserver {
 public:
  /// Throws SetupError.
  RunObserver(const Session& session, const OutputOptions& output, const TcpRules& tcp,
              bool may_observe, bool is_quiet)
      : session_(session),
        sides_(session),
        is_quiet_(is_quiet),
        links_({.priority = 0, .cpu = -1}, tcp),
        mirrors_(session.sides.size()),
        figures_(mirrors_.size()) {
    for (const std::string& table : tables_of(session, output)) {
      csvs_.push_back(std::make_unique<CsvWriter>(table, output.may_overwrite));
    }
    if (!may_observe) return;
    feed_.emplace(session, clock_, links_);
    if (session.task) {
      task_.emplace(*session.task, session.scene.tool());
      feed_->subscriber().subscribe<SceneState>();
    }
    if (!output.record_file.empty()) {
      recording_.emplace(output.record(), session, "palpate launch", feed_->subscriber());
      recording_->take(TelemetryMessage(run_), {});  // no marker yet
    }
    feed_->on_message = [this](const TelemetryMessage& message,
                               std::span<const std::byte> payload) {
      if (const auto* physics = std::get_if<PhysicsBatch>(&message)) warn_of_start(*physics);
      if (const auto* scene = std::get_if<SceneState>(&message); scene != nullptr && task_) {
        task_->take(*scene);
      }
      std::visit([this](const auto& batch) { add(batch); }, message);
      if (recording_) recording_->take(message, payload);
    };
    for (std::size_t i = 0; i < mirrors_.size(); ++i) {
      devices_.push_back({session.sides[i], mirrors_[i], figures_[i]});
      mirrors_[i].on_row = [this, i](const TickRow& row) {
        figures_[i].add(row);
        if (!csvs_.empty()) csvs_[i]->write(row);
        if (task_) task_->take(row);
      };
    }
  }

  /// Takes the telemetry that has arrived, and markers: `m` in the terminal, or from a page.
  void pump() {
    pump_markers();
    if (!feed_) return;
    feed_->pump(mirrors_, clock_.now());
    check_recording();
    heap_.note(clock_.now());
  }

  /// Call it at the end of the run: closes what is in the run folder.
  void leave_run_folder() {
    keys_.reset();
    host_.reset();
  }

  /// Call it after the run: completes the rows and closes the recording.
  void finish() {
    for (viewer::TelemetryMirror& mirror : mirrors_) mirror.flush_rows();
    if (task_) task_->finish();
    if (recording_) recording_->close();
    check_recording();
  }

  /// Throws std::runtime_error if a table or the recording is incomplete.
  void close_files() {
    for (const auto& csv : csvs_) {
      csv->close();
      if (const auto error = csv->take_error()) throw std::runtime_error(*error);
    }
    if (has_lost_recording_) throw std::runtime_error("the recording is incomplete");
  }

  /// Of the session's task, after finish(); null: it has none, or is not observed.
  [[nodiscard]] const TaskScore* task() const { return task_ ? &task_->score() : nullptr; }
  /// The task has ended long enough ago for its score to have been seen.
  [[nodiscard]] bool is_task_over() {
    if (!task_ || !task_->has_ended()) return false;
    if (!task_ended_at_) task_ended_at_ = clock_.now();
    return clock_.now() - *task_ended_at_ > kScoreShown;
  }

  /// Empty: this run is not observed.
  [[nodiscard]] const std::vector<ObservedDevice>& devices() const { return devices_; }

 private:
  template <class Message>
  void add(const Message& message) {
    if constexpr (requires { message.counters; }) {
      if (const auto side = sides_.of(message.side); side && *side < devices_.size()) {
        figures_[*side].add(message);
      }
    }
  }
  /// Tissue deforms for each tool separately: each side has its own first step.
  void warn_of_start(const PhysicsBatch& batch) {
    if (batch.records.empty() || !started_.insert(batch.side).second) return;
    const PhysicsTick& first = batch.records.front();
    if (first.sequence != 0) return;  // the batch with the first step is lost
    const std::string warning = start_warning(first);
    if (!warning.empty()) say(warning);
  }
  [[nodiscard]] std::string keys_text() const {
    if (!session_.task) return "press m to set a marker in the run";
    return std::string(session_.task->is_started_by_person ? "press t to start the task, again to "
                                                             "stop it"
                                                           : "press t to stop the task") +
           (session_.task->palpation() != nullptr ? "; press m to mark a find"
            : session_.task->needle() != nullptr  ? "; press m to mark the loss of resistance"
                                                  : "; press m to set a marker");
  }
  /// By a person, or by itself.
  [[nodiscard]] bool has_started_task() const {
    return !session_.task->is_started_by_person ||
           std::any_of(run_.markers.begin(), run_.markers.end(), [](const Marker& marker) {
             return marker.kind == Marker::Kind::kTaskStart;
           });
  }
  void set_marker(Marker marker) {
    marker.at_ns = wall_clock_ns();
    viewer::note_newest_tick(mirrors_, marker);
    markers_.add(std::move(marker));
  }
  void pump_markers() {
    if (!host_) {
      host_.emplace(links_.side, clock_, session_);
      keys_.emplace();
      if (keys_->is_on() && !is_quiet_) say(keys_text());
    }
    bool is_new = false;
    while (const char key = keys_->take()) {
      if (key == 't' && session_.task) {
        set_marker(
            {.origin = "terminal",
             .kind = has_started_task() ? Marker::Kind::kTaskStop : Marker::Kind::kTaskStart});
      } else if (key == 'm') {
        set_marker({.origin = "terminal"});
      } else {
        continue;
      }
      is_new = true;
    }
    while (const auto request = host_->take()) {
      if (!request->marker) continue;
      set_marker({.text = *request->marker, .origin = "page", .kind = request->marker_kind});
      is_new = true;
    }
    if (is_new) {
      run_.markers = markers_.newest();
      const Marker& marker = run_.markers.back();
      if (!is_quiet_) say("marker set: " + marker.text);
      if (recording_) recording_->take(TelemetryMessage(run_), {});
      if (task_) task_->take(run_.markers);
    }
    host_->publish(run_, is_new);
  }
  /// Reports an error at once; the run continues.
  void check_recording() {
    const auto error = recording_ ? recording_->take_error() : std::nullopt;
    if (!error) return;
    say(*error);
    has_lost_recording_ = true;
  }

  const Session& session_;
  viewer::SideIndex sides_;
  bool is_quiet_;
  SteadyClock clock_;
  ProcessLinks links_;
  std::optional<RunHost> host_;  // while the run folder exists
  std::optional<TerminalKeys> keys_;
  MarkerLog markers_;
  RunState run_;
  std::optional<viewer::TelemetryFeed> feed_;
  std::vector<viewer::TelemetryMirror> mirrors_;
  std::vector<RunFigures> figures_;
  std::vector<ObservedDevice> devices_;
  std::vector<std::unique_ptr<CsvWriter>> csvs_;
  std::optional<viewer::Recording> recording_;
  std::optional<TaskEvaluator> task_;
  std::optional<TimePoint> task_ended_at_;
  std::set<std::string> started_;  // sides whose physics was heard
  bool has_lost_recording_ = false;
  HeapTrim heap_;
};

bool LaunchCommand::has_standby_here(const Session& loaded) const {
  if (are_chosen && nodes.contains("standby") && !loaded.physics.standby) {
    throw SetupError("--nodes standby: " + loaded.file +
                     " has no physics.standby; leave standby out, or give physics { standby {} }");
  }
  if (!loaded.physics.standby || are_chosen) return nodes.contains("standby");
  const std::string& endpoint = loaded.side().links.standby_tool_motion;
  return !endpoint.starts_with("tcp://") ||
         is_on_loopback(bind_to(endpoint, "links.standby_tool_motion"));
}

/// What flight recorders of this session have written since then, by name.
std::vector<std::string> flight_files_since(const std::string& session,
                                            std::filesystem::file_time_type since) {
  std::vector<std::string> files;
  std::error_code error;
  const std::filesystem::path folder = run_folder(session).parent_path();
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const bool is_of_session = name.starts_with("flight-") && name.ends_with(".csv") &&
                               name.find("-" + session + "-2") != std::string::npos;
    if (is_of_session && entry.last_write_time(error) >= since) {
      files.push_back(entry.path().string());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

int LaunchCommand::run(const Verbosity& verbosity) const {
  const auto began_at = std::filesystem::file_time_type::clock::now();
  Session loaded = session.load(verbosity);
  if (is_insecure) allow_plain_tcp(loaded);
  leave_adversary_out(loaded, has_no_adversary);
  const auto code = foreign_code_of(loaded, nodes.contains("physics"), nodes.contains("device"));
  const std::string trusted = require_trust(loaded, code, is_trusted);
  if (!verbosity.is_quiet) {
    for (const std::string& line : foreign_code_lines(loaded, code)) say(line);
  }
  output.check(loaded, tables_of(loaded, output));
  JsonOutput json(output);
  std::set<std::string> here = nodes;
  if (!has_standby_here(loaded)) here.erase("standby");

  if (ends_with_task && !loaded.task) {
    throw SetupError("--until-task-ends: " + loaded.file +
                     " has no task; leave it out, or give task { … }");
  }
  // a viewer, a table and a recording need the viewer's key; the summary uses it if it is there
  const bool must_observe =
      nodes.contains("viewer") || !output.csv_file.empty() || !output.record_file.empty();
  const TcpRules tcp = must_observe ? tcp_rules(loaded.security, {KeyRole::kViewer})
                                    : tcp_rules(loaded.security, {}, {KeyRole::kViewer});
  const bool may_observe = tcp.keys == nullptr || tcp.keys->of(KeyRole::kViewer).has_value();
  if (!may_observe) {
    say("no figures of this run: " + loaded.security.key_folder + " has no viewer.key_secret");
  }
  // launch() handles them; the threads of the observer have ordinary priority
  std::optional<BlockedSignals> blocked{std::in_place,
                                        std::initializer_list<int>{SIGINT, SIGTERM, SIGHUP}};
  RunObserver observer(loaded, output, tcp, may_observe, verbosity.is_quiet);
  if (here.contains("device")) {
    if (const auto warning = too_many_ticks(loaded.sides.size()); !warning.empty()) say(warning);
    if (const auto warning = spin_warning(loaded.sides); !warning.empty() && !has_no_realtime) {
      say(warning);
    }
  }

  const WebConfig& web = loaded.viewer.web;
  const bool has_page = nodes.contains("viewer") && web.is_on && !verbosity.is_quiet;
  std::optional<ListeningPort> page;
  const auto take_page = [&] {
    if (has_page) page = announce_page(web);
    return page ? page->descriptor() : -1;
  };
  std::stop_source task_over;
  LaunchResult result =
      launch({.session_file = session.file,
              .overrides = session.overrides,
              .seconds = seconds,
              .is_realtime = !has_no_realtime,
              .is_insecure = is_insecure,
              .is_unsafe = is_unsafe,
              .is_emulated = is_emulated,
              .has_no_adversary = has_no_adversary,
              .is_quiet = verbosity.is_quiet || is_blind,
              .has_short_log = has_short_log(verbosity),
              .on_page = take_page,
              .nodes = here,
              .is_together = is_together,
              .before_restart = [&] { require_same_trust(loaded, code, trusted); },
              .on_poll =
                  [&] {
                    observer.pump();
                    if (ends_with_task && observer.is_task_over()) task_over.request_stop();
                  },
              .on_end = [&] { observer.leave_run_folder(); }},
             task_over.get_token());
  if (here.contains("device") && here.contains("mofc") && here.contains("physics")) {
    result.processors = usable_processors();
    if (double load = 0.0; getloadavg(&load, 1) == 1) result.load = load;
  }
  blocked.reset();
  observer.finish();
  if (result.end == LaunchEnd::kRefused) return result.exit_status();
  for (const auto& node : result.restarts) {
    if (node.came_up) continue;
    say(node.name + "_node never came up; its messages are above");
  }

  const std::vector<std::string> flights = flight_files_since(loaded.name, began_at);
  if (!verbosity.is_quiet) {
    if (!is_blind) std::fputs(launch_text(loaded, observer.devices(), result).c_str(), stdout);
    if (observer.task() != nullptr) std::fputs(score_text(*observer.task()).c_str(), stdout);
    for (const std::string& file : flights) {
      if (is_blind) {
        say("flight recording: " + file);
      } else {
        std::printf("flight recording: %s\n", file.c_str());
      }
    }
  }
  auto all = launch_json(loaded, observer.devices(), result);
  all["flight_recordings"] = flights;
  if (observer.task() != nullptr) all["task"] = score_json(*observer.task());
  json.write(all);
  observer.close_files();
  output.say_written(tables_of(loaded, output), verbosity);
  return exit_status(observer.devices(), result);
}

}  // namespace

Command add_launch_command(CLI::App& app) {
  return add_command<LaunchCommand>(
      app, "launch",
      "run a session in real time: start its nodes, restart those that fail, print a summary");
}

}  // namespace palpate
