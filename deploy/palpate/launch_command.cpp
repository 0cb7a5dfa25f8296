#include "deploy/palpate/launch_command.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

#include "common/core/check.h"
#include "common/telemetry/metrics.h"
#include "common/core/regular_file.h"
#include "common/process/heap_trim.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "deploy/palpate/json_output.h"
#include "deploy/launch/launch.h"
#include "common/telemetry/summary.h"
#include "common/telemetry/csv_writer.h"
#include "viewer_node/process.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate {
namespace {

/// What the launcher saw of one device's run: it is a viewer like any other, with the viewer's key.
struct Observed {
  DurationHistogram reply_time;
  DurationHistogram lateness;
  // a node's counters begin anew when it is started again, these do not
  double minimum_true_energy_joule = kNaN;
  double max_force_newton = 0.0;

  void note_extremes(const DeviceCounters& device) {
    minimum_true_energy_joule =
        std::fmin(minimum_true_energy_joule, device.minimum_true_energy_joule);
    max_force_newton = std::fmax(max_force_newton, device.max_force_newton);
  }
};

double mean_transparency(const MofcCounters& mofc) {
  return mofc.transparency_samples > 0
             ? mofc.transparency_sum / static_cast<double>(mofc.transparency_samples)
             : kNaN;
}

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : kNaN;
}

nlohmann::ordered_json percentiles(const DurationHistogram& histogram) {
  const auto at = [&](double q) {
    return number_or_null(histogram.count() > 0 ? to_seconds(histogram.quantile(q)) : kNaN);
  };
  return {{"p50_s", at(0.5)}, {"p99_s", at(0.99)}, {"p999_s", at(0.999)}, {"max_s", at(1.0)}};
}

/// One device of a run, with its session.
struct Watched {
  const Side& side;
  const viewer::TelemetryMirror& mirror;
  const Observed& observed;
};

nlohmann::ordered_json figures_json(const Watched& watched, const LaunchResult& result) {
  const Observed& observed = watched.observed;
  const DeviceCounters& device = watched.mirror.device_counters();
  const MofcCounters& mofc = watched.mirror.mofc_counters();
  const PhysicsCounters& physics = watched.mirror.physics_counters();
  nlohmann::ordered_json json;
  json["controller"] = controller_text(watched.side.mofc);
  json["ticks"] = device.loop.ticks;
  json["skipped_ticks"] = device.loop.skipped_ticks;
  json["in_contact_ticks"] = mofc.contact_ticks;
  json["transparency"] = {{"vector", number_or_null(mean_transparency(mofc))}};
  json["min_true_energy_j"] = number_or_null(observed.minimum_true_energy_joule);
  json["max_force_n"] = observed.max_force_newton;
  json["clamped_ticks"] = mofc.clamped_ticks;
  json["clamp_ratio"] = number_or_null(ratio(mofc.clamped_ticks, mofc.contact_ticks));
  json["answered_ratio"] = number_or_null(answered_ratio(device));
  json["motions_suppressed"] = mofc.motions_suppressed;
  json["interactions_suppressed"] = physics.interactions_suppressed;
  json["mesh_frames"] = physics.mesh_frames;
  json["meshes_skipped"] = physics.meshes_skipped;
  json["fallbacks"] = device.fallback_ticks + device.limp_ticks;
  json["reply_time"] = percentiles(observed.reply_time);
  json["lateness"] = percentiles(observed.lateness);
  json["ticks_per_wall_s"] =
      number_or_null(static_cast<double>(device.loop.ticks) / result.wall.count());
  return json;
}

/// The figures of several devices are those of `sides`, by name.
nlohmann::ordered_json launch_json(const std::string& name, const std::vector<Watched>& devices,
                                   const LaunchResult& result) {
  nlohmann::ordered_json restarts = nlohmann::ordered_json::object();
  for (const auto& node : result.restarts) restarts[node.name] = node.count;
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["session"] = name;
  for (const Watched& device : devices) {
    const std::string& side = device.side.name;
    if (side.empty()) {
      json.update(figures_json(device, result));
    } else {
      json["sides"][side] = figures_json(device, result);
    }
  }
  json["restarts"] = restarts;
  json["wall_s"] = result.wall.count();
  return json;
}

std::string launch_text(const std::string& name, const std::vector<Watched>& devices,
                        const LaunchResult& result) {
  const auto micro = [](Duration d) { return static_cast<double>(d.count()) * 1e-3; };
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<20}{}\n", label, value);
  };
  if (devices.empty()) {
    text += fmt::format("{}: {:.1f} s in real time, no figures without the viewer's key\n", name,
                        result.wall.count());
  }
  for (const auto& [side, mirror, observed] : devices) {
    const DeviceCounters& device = mirror.device_counters();
    const MofcCounters& mofc = mirror.mofc_counters();
    text += fmt::format("{}: {}, {:.1f} s in real time\n",
                        name + (side.name.empty() ? "" : ", " + side.name),
                        controller_text(side.mofc), result.wall.count());
    if (!mirror.device_link().is_heard()) {
      line("device", "not heard");
      continue;
    }
    line("in contact", fmt::format("{} of {} ticks", mofc.contact_ticks, mofc.ticks));
    if (side.mofc.controller != ControllerKind::kNone) {
      line("clamped by MOFC", fmt::format("{} ticks", mofc.clamped_ticks));
    }
    line("transparency", figure(mean_transparency(mofc), "{:.3f}") + " (force acting / asked)");
    line("largest force", fmt::format("{:.3f} N", observed.max_force_newton));
    if (!std::isnan(observed.minimum_true_energy_joule)) {
      line("least true energy",
           fmt::format("{:.3f} µJ (0 or more: passive)", 1e6 * observed.minimum_true_energy_joule));
    }
    line("answered in time",
         figure(100.0 * answered_ratio(device), "{:.3f} %") +
             fmt::format(" of {} scheduled ticks ({} skipped)",
                         device.loop.ticks + device.loop.skipped_ticks, device.loop.skipped_ticks));
    line("reply time", fmt::format("p50 {:.0f} µs, p99 {:.0f} µs, p99.9 {:.0f} µs",
                                   micro(observed.reply_time.quantile(0.5)),
                                   micro(observed.reply_time.quantile(0.99)),
                                   micro(observed.reply_time.quantile(0.999))));
    line("tick lateness", fmt::format("p50 {:.0f} µs, p99 {:.0f} µs, p99.9 {:.0f} µs",
                                      micro(observed.lateness.quantile(0.5)),
                                      micro(observed.lateness.quantile(0.99)),
                                      micro(observed.lateness.quantile(0.999))));
    line("without an answer",
         fmt::format("{} ticks on the lease, {} in fallback, {} limp", device.leased_ticks,
                     device.fallback_ticks, device.limp_ticks));
  }
  for (const auto& node : result.restarts) {
    if (node.count == 0) continue;
    line("restarted", fmt::format("{}, {} times; its counts are those since the last start",
                                  node.name, node.count));
  }
  return text;
}

}  // namespace

int LaunchCommand::run() const {
  Session session = load_session(session_file, overrides);
  if (is_insecure) allow_plain_tcp(session);
  refuse_shared_file({{"--csv", csv_file}, {"--json", json_file}, {"--record", record.file}});
  const JsonOutput json(json_file);
  const std::vector<Side>& sides = session.sides;
  std::vector<std::unique_ptr<CsvWriter>> csvs;
  for (const Side& side : sides) {
    if (csv_file.empty()) break;
    csvs.push_back(std::make_unique<CsvWriter>(csv_file_of(csv_file, side.name)));
  }

  // who asks for more than the summary must have the viewer's key
  const bool must_look = nodes.contains("viewer") || !csv_file.empty() || !record.file.empty();
  const TcpRules tcp = must_look ? tcp_rules(session.security, {KeyRole::kViewer})
                                 : tcp_rules(session.security, {}, {KeyRole::kViewer});
  const bool may_look = tcp.keys == nullptr || tcp.keys->of(KeyRole::kViewer).has_value();
  if (!may_look) {
    std::fprintf(stderr, "palpate: no figures of this run: %s has no viewer.key_secret\n",
                 session.security.key_folder.c_str());
  }
  const SteadyClock clock;
  ProcessLinks links({.priority = 0, .cpu = -1}, tcp);
  std::optional<viewer::TelemetryFeed> feed;
  if (may_look) feed.emplace(session, clock, links);
  std::optional<viewer::Recording> recording;
  if (!record.file.empty()) {
    recording.emplace(record, session, "palpate launch", feed->subscriber());
    feed->on_message = [&](const TelemetryMessage& message, std::span<const std::byte> payload) {
      recording->take(message, payload);
    };
  }
  std::optional<std::string> lost_recording;
  const auto check_recording = [&] {  // told at once; the run goes on
    const auto error = recording ? recording->take_error() : std::nullopt;
    if (!error) return;
    std::fprintf(stderr, "palpate: %s\n", error->c_str());
    lost_recording = error;
  };
  std::vector<viewer::TelemetryMirror> mirrors(sides.size());
  std::vector<Observed> observed(sides.size());
  std::vector<Watched> devices;
  for (std::size_t i = 0; may_look && i < sides.size(); ++i) {
    devices.push_back({sides[i], mirrors[i], observed[i]});
    mirrors[i].on_row = [&, i](const TickRow& row) {
      observed[i].lateness.add(row.device.lateness);
      if (row.device.is_answered) observed[i].reply_time.add(row.device.reply_time);
      if (!csvs.empty()) csvs[i]->write(row);
    };
  }

  std::set<std::string> started = nodes;
  if (json.is_standard_output()) started.erase("viewer");
  HeapTrim heap;
  const LaunchResult result = launch({.session_file = session_file,
                                      .overrides = overrides,
                                      .seconds = seconds,
                                      .is_realtime = is_realtime,
                                      .is_insecure = is_insecure,
                                      .nodes = started,
                                      .is_together = is_together,
                                      .on_poll = [&] {
                                        if (!feed) return;
                                        feed->pump(mirrors, clock.now());
                                        for (std::size_t i = 0; i < sides.size(); ++i) {
                                          observed[i].note_extremes(mirrors[i].device_counters());
                                        }
                                        check_recording();
                                        heap.note(clock.now());
                                      }});
  for (viewer::TelemetryMirror& mirror : mirrors) mirror.flush_rows();
  if (recording) recording->close();
  check_recording();
  if (result.exit_status() != 0) return result.exit_status();

  if (!json.is_standard_output()) {
    std::fputs(launch_text(session.name, devices, result).c_str(), stdout);
  }
  json.write(launch_json(session.name, devices, result));
  for (const auto& csv : csvs) {
    csv->close();
    if (const auto error = csv->take_error()) throw std::runtime_error(*error);
  }
  if (lost_recording) throw std::runtime_error("the recording is not whole");
  return 0;
}

}  // namespace palpate
