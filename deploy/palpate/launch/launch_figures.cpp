// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/launch/launch_figures.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "common/process/run_node.h"
#include "common/telemetry/summary.h"
#include "common/telemetry/verdict/verdict.h"
#include "deploy/palpate/screen/verdict.h"

namespace palpate {
namespace {

nlohmann::ordered_json device_json(const Session& session, const ObservedDevice& observed,
                                   const LaunchResult& result) {
  nlohmann::ordered_json json =
      figures_json(controller_text(observed.side.mofc), observed.mirror, observed.figures);
  json["ticks_per_wall_s"] =
      number_or_null(static_cast<double>(observed.figures.device.loop.ticks) / result.wall.count());
  json["verdict"] = verdict_json(judge(facts_of(session, observed, result)));
  return json;
}

}  // namespace

RunFacts facts_of(const Session& session, const ObservedDevice& device,
                  const LaunchResult& result) {
  RunFacts facts = facts_of(facts_of(session, device.side), device.mirror, device.figures);
  const auto add = [&](RunFacts::Node& node, const std::string& name) {
    for (const auto& restarts : result.restarts) {
      if (restarts.name == name) node.restarts = std::max(node.restarts, restarts.count);
    }
  };
  const std::string& side = device.side.name;
  add(facts.device_node, with_side(side, "device"));
  add(facts.mofc_node, with_side(side, "mofc"));
  for (RunFacts::Node* node : std::array{&facts.device_node, &facts.mofc_node}) {
    add(*node, with_side(side, "device_mofc"));
  }
  add(facts.physics_node, "physics");
  facts.processors = result.processors;
  facts.load = result.load;
  return facts;
}

int exit_status(const std::vector<ObservedDevice>& devices, const LaunchResult& result) {
  const int status = result.exit_status();
  const bool has_fault = std::any_of(devices.begin(), devices.end(), [](const auto& device) {
    const DeviceCounters& counters = device.mirror.device_counters();
    return counters.device_faults > counters.fault_resets;
  });
  return status == 0 && has_fault ? kExitFailure : status;
}

nlohmann::ordered_json launch_json(const Session& session,
                                   const std::vector<ObservedDevice>& devices,
                                   const LaunchResult& result) {
  nlohmann::ordered_json restarts = nlohmann::ordered_json::object();
  for (const auto& node : result.restarts) restarts[node.name] = node.count;
  nlohmann::ordered_json json;
  json["schema_version"] = kSummarySchemaVersion;
  json["session"] = session.name;
  for (const ObservedDevice& device : devices) {
    const std::string& side = device.side.name;
    if (side.empty()) {
      json.update(device_json(session, device, result));
    } else {
      json["sides"][side] = device_json(session, device, result);
    }
  }
  json["restarts"] = restarts;
  json["wall_s"] = result.wall.count();
  return json;
}

std::string launch_text(const Session& session, const std::vector<ObservedDevice>& devices,
                        const LaunchResult& result) {
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<20}{}\n", label, value);
  };
  if (devices.empty()) {
    text += fmt::format("{}: {:.1f} s in real time, no figures without the viewer's key\n",
                        session.name, result.wall.count());
  }
  for (const ObservedDevice& device : devices) {
    const auto& [side, mirror, figures] = device;
    text += fmt::format("{}: {}, {:.1f} s in real time\n",
                        session.name + (side.name.empty() ? "" : ", " + side.name),
                        controller_text(side.mofc), result.wall.count());
    if (mirror.device_link().is_heard())
      for (const auto& [label, value] : figure_lines(controller_text(side.mofc), mirror, figures)) {
        line(label.c_str(), value);
      }
    text += verdict_text(judge(facts_of(session, device, result)));
  }
  for (const auto& node : result.restarts) {
    if (node.count == 0) continue;
    line("restarted", fmt::format("{}, {}", node.name,
                                  node.count == 1 ? "once" : fmt::format("{} times", node.count)));
  }
  return text;
}

}  // namespace palpate
