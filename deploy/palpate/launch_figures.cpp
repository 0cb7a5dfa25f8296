#include "deploy/palpate/launch_figures.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"
#include "deploy/palpate/screen/verdict.h"

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

nlohmann::ordered_json figures_json(const ObservedDevice& observed, const LaunchResult& result) {
  const ObservedFigures& figures = observed.figures;
  const DeviceCounters& device = observed.mirror.device_counters();
  const MofcCounters& mofc = observed.mirror.mofc_counters();
  const PhysicsCounters& physics = observed.mirror.physics_counters();
  nlohmann::ordered_json json;
  json["controller"] = controller_text(observed.side.mofc);
  json["ticks"] = device.loop.ticks;
  json["skipped_ticks"] = device.loop.skipped_ticks;
  json["in_contact_ticks"] = mofc.contact_ticks;
  json["transparency"] = {{"vector", number_or_null(mean_transparency(mofc))}};
  json["min_true_energy_j"] = number_or_null(figures.minimum_true_energy_joule);
  json["max_force_n"] = figures.max_force_newton;
  json["largest_jump_n"] = figures.largest_jump_newton;
  json["monitor"] = device.is_monitor_off ? "off" : "on";
  json["monitor_reductions"] = device.monitor_reductions;
  json["clamped_ticks"] = mofc.clamped_ticks;
  json["clamp_ratio"] = number_or_null(ratio(mofc.clamped_ticks, mofc.contact_ticks));
  json["answered_ratio"] = number_or_null(answered_ratio(device));
  json["motions_suppressed"] = mofc.motions_suppressed;
  json["interactions_suppressed"] = physics.interactions_suppressed;
  json["mesh_frames"] = physics.mesh_frames;
  json["meshes_skipped"] = physics.meshes_skipped;
  json["fallbacks"] = device.fallback_ticks + device.limp_ticks;
  json["reply_time"] = percentiles_json(figures.reply_time);
  json["lateness"] = percentiles_json(figures.lateness);
  json["ticks_per_wall_s"] =
      number_or_null(static_cast<double>(device.loop.ticks) / result.wall.count());
  return json;
}

}  // namespace

void ObservedFigures::add(const TickRow& row) {
  lateness.add(row.device.lateness);
  if (row.device.is_answered) reply_time.add(row.device.reply_time);
}

void ObservedFigures::add(const DeviceCounters& device) {
  minimum_true_energy_joule =
      std::fmin(minimum_true_energy_joule, device.minimum_true_energy_joule);
  max_force_newton = std::fmax(max_force_newton, device.max_force_newton);
  largest_jump_newton = std::fmax(largest_jump_newton, device.largest_jump_newton);
}

nlohmann::ordered_json launch_json(const std::string& name,
                                   const std::vector<ObservedDevice>& devices,
                                   const LaunchResult& result) {
  nlohmann::ordered_json restarts = nlohmann::ordered_json::object();
  for (const auto& node : result.restarts) restarts[node.name] = node.count;
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["session"] = name;
  for (const ObservedDevice& device : devices) {
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

std::string launch_text(const std::string& name, const std::vector<ObservedDevice>& devices,
                        const LaunchResult& result) {
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<20}{}\n", label, value);
  };
  if (devices.empty()) {
    text += fmt::format("{}: {:.1f} s in real time, no figures without the viewer's key\n", name,
                        result.wall.count());
  }
  for (const auto& [side, mirror, figures] : devices) {
    const DeviceCounters& device = mirror.device_counters();
    const MofcCounters& mofc = mirror.mofc_counters();
    text += fmt::format("{}: {}, {:.1f} s in real time\n",
                        name + (side.name.empty() ? "" : ", " + side.name),
                        controller_text(side.mofc), result.wall.count());
    if (!mirror.device_link().is_heard()) {
      line("device", "no telemetry received");
      continue;
    }
    line("in contact", fmt::format("{} of {} ticks", mofc.contact_ticks, mofc.ticks));
    if (side.mofc.controller != ControllerKind::kNone) {
      line("clamped by MOFC", fmt::format("{} ticks", mofc.clamped_ticks));
    }
    line("transparency",
         figure(mean_transparency(mofc), "{:.3f}") + " (rendered / requested force)");
    line("largest force", fmt::format("{:.3f} N, largest jump from tick to tick {:.3f} N",
                                      figures.max_force_newton, figures.largest_jump_newton));
    line("monitor", monitor_text(device));
    if (!std::isnan(figures.minimum_true_energy_joule)) {
      line("least true energy",
           fmt::format("{:.3f} µJ (0 or more: passive)", 1e6 * figures.minimum_true_energy_joule));
    }
    line("answered in time",
         figure(100.0 * answered_ratio(device), "{:.3f} %") +
             fmt::format(" of {} scheduled ticks ({} skipped)",
                         device.loop.ticks + device.loop.skipped_ticks, device.loop.skipped_ticks));
    line("reply time", percentiles_text(figures.reply_time));
    line("tick lateness", percentiles_text(figures.lateness));
    line("without an answer",
         fmt::format("{} ticks on the lease, {} in fallback, {} limp", device.leased_ticks,
                     device.fallback_ticks, device.limp_ticks));
    text += verdict_text(verdicts_of(side, device, mofc, true));
  }
  for (const auto& node : result.restarts) {
    if (node.count == 0) continue;
    line("restarted", fmt::format("{}, {} times; its counters cover the time since the last start",
                                  node.name, node.count));
  }
  return text;
}

}  // namespace palpate
