#include "viewer_node/metrics_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

namespace palpate::viewer {
namespace {

std::string number(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  char text[32];
  std::snprintf(text, sizeof(text), "%.9g", value);
  return text;
}

/// One metric: its head, then a line for each set of labels.
class Metric {
 public:
  Metric(std::string& page, const char* type, const std::string& name, const char* help)
      : page_(page), name_("palpate_" + name) {
    page_ += "# HELP " + name_ + " " + help + "\n# TYPE " + name_ + " " + type + "\n";
  }
  /// @param labels  `node="device"`; "" for none
  Metric& value(const std::string& labels, const std::string& text) {
    page_ += name_ + (labels.empty() ? "" : "{" + labels + "}") + " " + text + "\n";
    return *this;
  }
  Metric& value(const std::string& labels, std::uint64_t count) {
    return value(labels, std::to_string(count));
  }
  Metric& value(const std::string& labels, double figure) { return value(labels, number(figure)); }

 private:
  std::string& page_;
  std::string name_;
};

using Counts = std::vector<std::pair<std::string, std::uint64_t>>;  // by label

void counter(std::string& page, const std::string& name, const char* help, const Counts& counts) {
  if (counts.empty()) return;
  Metric metric(page, "counter", name + "_total", help);
  for (const auto& [labels, count] : counts) metric.value(labels, count);
}

std::string label(const char* name, const std::string& value) {
  return std::string(name) + "=\"" + value + "\"";
}

void add_link(Counts& counts, const char* link, const LinkCounters& counters) {
  for (const auto& [result, count] :
       {std::pair{"accepted", counters.accepted}, std::pair{"skipped", counters.skipped},
        std::pair{"duplicate", counters.duplicates},
        std::pair{"out_of_order", counters.out_of_order},
        std::pair{"rejected", counters.rejected}}) {
    counts.emplace_back(label("link", link) + "," + label("result", result), count);
  }
}

void add_device(std::string& page, const DeviceCounters& c) {
  counter(page, "device_ticks", "Ticks by what the motors did.",
          {{label("force", "answered"), c.answered_ticks},
           {label("force", "leased"), c.leased_ticks},
           {label("force", "fallback"), c.fallback_ticks},
           {label("force", "limp"), c.limp_ticks},
           {label("force", "fault"), c.fault_ticks}});
  counter(page, "device_peak_limited_ticks", "Ticks at the device's force limit.",
          {{"", c.peak_limited_ticks}});
  counter(page, "device_faults", "Faults that were latched.", {{"", c.device_faults}});
  counter(page, "device_fault_resets", "Faults that were reset.", {{"", c.fault_resets}});
  counter(page, "device_non_finite_commands", "Answers with NaN or infinity, not rendered.",
          {{"", c.non_finite_commands}});
  Metric(page, "gauge", "device_max_force_newtons", "Greatest force since the start.")
      .value("", c.max_force_newton);
  Metric(page, "gauge", "device_minimum_true_energy_joules",
         "Least energy the hand has given, since the start; simulated devices only.")
      .value("", c.minimum_true_energy_joule);
}

void add_mofc(std::string& page, const MofcCounters& c) {
  counter(page, "mofc_ticks", "DeviceStates answered.", {{"", c.ticks}});
  counter(page, "mofc_ticks_in", "Of these, in each condition.",
          {{label("condition", "contact"), c.contact_ticks},
           {label("condition", "clamped"), c.clamped_ticks},
           {label("condition", "too_fast"), c.too_fast_ticks},
           {label("condition", "stale"), c.stale_ticks},
           {label("condition", "late_physics"), c.late_physics_ticks}});
  counter(page, "mofc_ledger_resets", "Energy ledgers begun anew.", {{"", c.ledger_resets}});
  counter(page, "mofc_motions_dropped", "Motions that the link to physics did not take.",
          {{"", c.motions_dropped}});
  counter(page, "mofc_motions_suppressed", "Motions within the deadband, not sent.",
          {{"", c.motions_suppressed}});
  Metric(page, "gauge", "mofc_transparency_ratio", "Force applied against force asked, mean.")
      .value("", c.transparency_samples > 0
                     ? c.transparency_sum / static_cast<double>(c.transparency_samples)
                     : kNaN);
}

void add_physics(std::string& page, const PhysicsCounters& c) {
  counter(page, "physics_contact_steps", "Steps with the tool in contact.",
          {{"", c.contact_steps}});
  counter(page, "physics_tissues", "Tissues looked at or skipped, summed over steps.",
          {{label("result", "visited"), c.tissues_visited},
           {label("result", "skipped"), c.tissues_skipped}});
  counter(page, "physics_octree_cells_visited", "Cells of point clouds, summed over steps.",
          {{"", c.octree_cells_visited}});
  counter(page, "physics_interactions_suppressed", "Interactions within the deadband, not sent.",
          {{"", c.interactions_suppressed}});
  counter(page, "physics_mesh_frames", "Frames of tissue made for viewers.", {{"", c.mesh_frames}});
  counter(page, "physics_meshes_skipped", "Times that frames were due and nobody looked on.",
          {{"", c.meshes_skipped}});
  Metric(page, "gauge", "physics_worst_compute_time_seconds", "Longest step since the start.")
      .value("", to_seconds(c.worst_compute_time));
}

}  // namespace

void TimeHistogram::add(Duration time) noexcept {
  const double s = to_seconds(time);
  const auto* bound = std::lower_bound(kBounds_s.begin(), kBounds_s.end(), s);
  ++counts_[static_cast<std::size_t>(bound - kBounds_s.begin())];
  sum_s_ += s;
}

std::string TimeHistogram::text(const std::string& name, const std::string& help) const {
  const std::string full = "palpate_" + name;
  std::string text = "# HELP " + full + " " + help + "\n# TYPE " + full + " histogram\n";
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    count += counts_[i];
    text += full + "_bucket{le=\"" + (i < kBounds_s.size() ? number(kBounds_s[i]) : "+Inf") +
            "\"} " + std::to_string(count) + "\n";
  }
  return text + full + "_sum " + number(sum_s_) + "\n" + full + "_count " + std::to_string(count) +
         "\n";
}

void MetricsText::note(const DeviceBatch& batch) noexcept {
  for (const DeviceTick& tick : batch.records) {
    lateness_.add(tick.lateness);
    if (tick.is_answered) reply_time_.add(tick.reply_time);
  }
}

void MetricsText::note(const MofcBatch& batch) noexcept {
  for (const MofcTick& tick : batch.records) {
    if (tick.state == MofcState::kContact) force_age_.add(tick.force_age);
  }
}

void MetricsText::note(const PhysicsBatch& batch) noexcept {
  for (const PhysicsTick& tick : batch.records) compute_time_.add(tick.compute_time);
}

std::string MetricsText::text(const TelemetryMirror& mirror, const ViewerCounts& viewer,
                              TimePoint now) const {
  const std::array<std::pair<const char*, const NodeLink&>, 3> nodes{
      {{"device", mirror.device_link()},
       {"mofc", mirror.mofc_link()},
       {"physics", mirror.physics_link()}}};
  const bool has_device = mirror.device_link().is_heard();
  const bool has_mofc = mirror.mofc_link().is_heard();
  const bool has_physics = mirror.physics_link().is_heard();
  std::string page;

  Metric up(page, "gauge", "node_up", "Whether the node is heard.");
  for (const auto& [name, link] : nodes) {
    up.value(label("node", name), std::uint64_t{link.is_alive(now) ? 1U : 0U});
  }
  Counts sessions;
  Counts lost;
  Counts records_lost;
  Counts refused;
  for (const auto& [name, link] : nodes) {
    if (!link.is_heard()) continue;
    sessions.emplace_back(label("node", name), link.sessions);
    lost.emplace_back(label("node", name), link.batches_lost);
    records_lost.emplace_back(label("node", name), link.records_lost);
    refused.emplace_back(label("node", name), link.peers_refused);
  }
  counter(page, "node_sessions", "Starts of the node, as heard.", sessions);
  counter(page, "telemetry_batches_lost", "Batches of telemetry that did not arrive.", lost);
  counter(page, "telemetry_records_lost", "Ticks that the node could not keep.", records_lost);
  counter(page, "peers_refused", "Connections that failed for want of the right keys.", refused);

  Counts ticks;
  Counts skipped;
  Counts messages;
  std::vector<std::pair<std::string, double>> lateness;
  const auto add_loop = [&](const char* node, const LoopCounters& loop) {
    ticks.emplace_back(label("node", node), loop.ticks);
    skipped.emplace_back(label("node", node), loop.skipped_ticks);
    lateness.emplace_back(label("node", node), to_seconds(loop.worst_lateness));
  };
  if (has_device) {
    add_loop("device", mirror.device_counters().loop);
    add_link(messages, "force_command", mirror.device_counters().force_command);
  }
  if (has_mofc) {
    add_link(messages, "device_state", mirror.mofc_counters().device_state);
    add_link(messages, "interaction", mirror.mofc_counters().interaction);
  }
  if (has_physics) {
    add_loop("physics", mirror.physics_counters().loop);
    add_link(messages, "tool_motion", mirror.physics_counters().tool_motion);
  }
  counter(page, "loop_ticks", "Turns of the periodic loop.", ticks);
  counter(page, "loop_skipped_ticks", "Turns missed by overruns.", skipped);
  if (!lateness.empty()) {
    Metric metric(page, "gauge", "loop_worst_lateness_seconds", "Latest wake-up since the start.");
    for (const auto& [labels, seconds] : lateness) metric.value(labels, seconds);
  }
  counter(page, "link_messages", "Messages that arrived on a link, by what became of them.",
          messages);

  if (has_device) add_device(page, mirror.device_counters());
  if (has_mofc) add_mofc(page, mirror.mofc_counters());
  if (has_physics) add_physics(page, mirror.physics_counters());

  page += reply_time_.text("reply_time_seconds", "From the device's reading to its answer.");
  page += lateness_.text("tick_lateness_seconds", "Of the device's wake-up.");
  page += force_age_.text("force_age_seconds",
                          "From the reading that physics answers to its use, in contact.");
  page += compute_time_.text("physics_compute_time_seconds", "Of a physics step.");

  Metric(page, "gauge", "viewer_clients", "WebSockets open.")
      .value("", std::uint64_t{viewer.clients});
  counter(page, "viewer_messages_dropped", "Messages not sent to slow clients.",
          {{"", viewer.messages_dropped}});
  counter(page, "viewer_requests_refused", "Requests and connections refused.",
          {{"", viewer.requests_refused}});
  counter(page, "viewer_frames_rejected", "Telemetry that could not be read.",
          {{"", viewer.frames_rejected}});
  return page;
}

}  // namespace palpate::viewer
