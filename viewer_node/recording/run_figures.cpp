#include "viewer_node/recording/run_figures.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <variant>

namespace palpate {
namespace {

double mean_transparency(const MofcCounters& mofc) {
  return mofc.transparency_samples > 0
             ? mofc.transparency_sum / static_cast<double>(mofc.transparency_samples)
             : kNaN;
}

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : kNaN;
}

nlohmann::ordered_json percentiles_json(const DurationHistogram& histogram) {
  const auto at = [&](double q) {
    return number_or_null(histogram.count() > 0 ? to_seconds(histogram.quantile(q)) : kNaN);
  };
  return {{"p50_s", at(0.5)}, {"p99_s", at(0.99)}, {"p999_s", at(0.999)}, {"max_s", at(1.0)}};
}

std::string percentiles_text(const DurationHistogram& histogram) {
  const auto micro = [&](double q) { return to_seconds(histogram.quantile(q)) * 1e6; };
  return fmt::format("p50 {:.0f} µs, p99 {:.0f} µs, p99.9 {:.0f} µs", micro(0.5), micro(0.99),
                     micro(0.999));
}

}  // namespace

void RunFigures::add(const TickRow& row) {
  lateness.add(row.device.lateness);
  if (row.device.is_answered) reply_time.add(row.device.reply_time);
  statistics.add(row, {});
}

void RunFigures::add(const DeviceCounters& device) {
  minimum_true_energy_joule =
      std::fmin(minimum_true_energy_joule, device.minimum_true_energy_joule);
  max_force_newton = std::fmax(max_force_newton, device.max_force_newton);
  largest_jump_newton = std::fmax(largest_jump_newton, device.largest_jump_newton);
}

nlohmann::ordered_json figures_json(const std::string& controller,
                                    const viewer::TelemetryMirror& mirror,
                                    const RunFigures& figures) {
  const DeviceCounters& device = mirror.device_counters();
  const MofcCounters& mofc = mirror.mofc_counters();
  const PhysicsCounters& physics = mirror.physics_counters();
  nlohmann::ordered_json json;
  json["controller"] = controller;
  json["ticks"] = device.loop.ticks;
  json["skipped_ticks"] = device.loop.skipped_ticks;
  json["in_contact_ticks"] = mofc.contact_ticks;
  json["transparency"] = {{"vector", number_or_null(mean_transparency(mofc))}};
  json["min_true_energy_j"] = number_or_null(figures.minimum_true_energy_joule);
  json["max_force_n"] = figures.max_force_newton;
  json["largest_jump_n"] = figures.largest_jump_newton;
  json["monitor"] = device.is_monitor_off ? "off" : "on";
  json["monitor_reductions"] = device.monitor_reductions;
  json["has_motor_watchdog"] = !device.has_no_motor_watchdog;
  json["accepts_no_motor_watchdog"] = device.accepts_no_motor_watchdog;
  json["clamped_ticks"] = mofc.clamped_ticks;
  json["clamp_ratio"] = number_or_null(ratio(mofc.clamped_ticks, mofc.contact_ticks));
  json["answered_ratio"] = number_or_null(answered_ratio(device));
  json["motions_suppressed"] = mofc.motions_suppressed;
  json["physics_term"] = mofc.physics_term;
  json["standby_ticks"] = mofc.standby_ticks;
  json["physics_switches"] = mofc.physics_switches;
  json["interactions_suppressed"] = physics.interactions_suppressed;
  json["mesh_frames"] = physics.mesh_frames;
  json["meshes_skipped"] = physics.meshes_skipped;
  json["fallbacks"] = device.fallback_ticks + device.limp_ticks;
  json["reply_time"] = percentiles_json(figures.reply_time);
  json["lateness"] = percentiles_json(figures.lateness);
  const RunStatistics& received = figures.statistics;
  json["received"] = {{"ticks", received.ticks()},
                      {"transparency", number_or_null(received.vector_transparency())},
                      {"clamp_ratio", number_or_null(received.clamp_ratio())}};
  return json;
}

std::vector<std::pair<std::string, std::string>> figure_lines(const std::string& controller,
                                                              const viewer::TelemetryMirror& mirror,
                                                              const RunFigures& figures) {
  const DeviceCounters& device = mirror.device_counters();
  const MofcCounters& mofc = mirror.mofc_counters();
  std::vector<std::pair<std::string, std::string>> lines;
  const auto line = [&](const char* label, std::string value) {
    lines.emplace_back(label, std::move(value));
  };
  line("in contact", fmt::format("{} of {} ticks", mofc.contact_ticks, mofc.ticks));
  if (!controller.starts_with("none")) {
    line("clamped by MOFC", fmt::format("{} ticks", mofc.clamped_ticks));
  }
  line("transparency", figure(mean_transparency(mofc), "{:.3f}") + " (rendered / requested force)");
  line("largest force", fmt::format("{:.3f} N, largest jump from tick to tick {:.3f} N",
                                    figures.max_force_newton, figures.largest_jump_newton));
  line("monitor", monitor_text(device));
  if (device.has_no_motor_watchdog)
    line("motor watchdog", no_watchdog_text(device.accepts_no_motor_watchdog));
  if (device.dead_man_ticks > 0) {
    line("dead-man button", fmt::format("not held in {} ticks", device.dead_man_ticks));
  }
  if (!std::isnan(figures.minimum_true_energy_joule)) {
    line("least true energy",
         fmt::format("{:.3f} µJ (0 or more: passive)", 1e6 * figures.minimum_true_energy_joule));
  }
  if (mofc.standby_interaction.sessions > 0) line("physics", speaker_text(mofc));
  line("answered in time",
       figure(100.0 * answered_ratio(device), "{:.3f} %") +
           fmt::format(" of {} scheduled ticks ({} skipped)",
                       device.loop.ticks + device.loop.skipped_ticks, device.loop.skipped_ticks));
  line("telemetry",
       fmt::format("{} of {} ticks received", figures.statistics.ticks(), device.loop.ticks));
  line("reply time", percentiles_text(figures.reply_time) + " of the ticks received");
  line("tick lateness", percentiles_text(figures.lateness) + " of the ticks received");
  line("without an answer",
       fmt::format("{} ticks on the lease, {} in fallback, {} limp", device.leased_ticks,
                   device.fallback_ticks, device.limp_ticks));
  return lines;
}

void read_run(RecordingFile& recording, RecordedRun& run,
              const std::function<void(const TickRow&)>& on_row,
              const std::function<void(const RecordingFile::Item&)>& on_item) {
  run.mirror.on_row = [&](TickRow row) {
    recording.complete(row);
    run.figures.add(row);
    if (on_row) on_row(row);
  };
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    const TimePoint at{Duration(static_cast<std::int64_t>(item->log_time_ns))};
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { run.mirror.take(message, at); }) run.mirror.take(message, at);
        },
        item->message);
    if (const auto* device = std::get_if<DeviceBatch>(&item->message)) {
      run.figures.add(device->counters);
    }
    if (on_item) on_item(*item);
  }
  run.mirror.flush_rows();
  run.mirror.on_row = {};
}

}  // namespace palpate
