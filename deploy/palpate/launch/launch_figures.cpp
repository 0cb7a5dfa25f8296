#include "deploy/palpate/launch/launch_figures.h"

#include <spdlog/fmt/fmt.h>

#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"
#include "deploy/palpate/screen/verdict.h"

namespace palpate {
namespace {

nlohmann::ordered_json device_json(const ObservedDevice& observed, const LaunchResult& result) {
  nlohmann::ordered_json json =
      figures_json(controller_text(observed.side.mofc), observed.mirror, observed.figures);
  json["ticks_per_wall_s"] = number_or_null(
      static_cast<double>(observed.mirror.device_counters().loop.ticks) / result.wall.count());
  return json;
}

}  // namespace

nlohmann::ordered_json launch_json(const std::string& name,
                                   const std::vector<ObservedDevice>& devices,
                                   const LaunchResult& result) {
  nlohmann::ordered_json restarts = nlohmann::ordered_json::object();
  for (const auto& node : result.restarts) restarts[node.name] = node.count;
  nlohmann::ordered_json json;
  json["schema_version"] = kSummarySchemaVersion;
  json["session"] = name;
  for (const ObservedDevice& device : devices) {
    const std::string& side = device.side.name;
    if (side.empty()) {
      json.update(device_json(device, result));
    } else {
      json["sides"][side] = device_json(device, result);
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
    for (const auto& [label, value] : figure_lines(controller_text(side.mofc), mirror, figures)) {
      line(label.c_str(), value);
    }
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
