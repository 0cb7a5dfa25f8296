#include "viewer_node/feed/metrics_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <initializer_list>

namespace palpate::viewer {
namespace {

std::string number(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  char text[32];
  std::snprintf(text, sizeof(text), "%.9g", value);
  return text;
}

std::string label(const char* name, const std::string& value) {
  return std::string(name) + "=\"" + value + "\"";
}

struct Count {
  std::string labels;  // `node="device"`; "" for none
  std::uint64_t count = 0;
};

/// Metrics as they come, side after side; all lines of one stand together under its head.
class Page {
 public:
  /// That of the lines that follow; "" for none.
  void begin_side(const std::string& side) { side_ = side.empty() ? "" : label("side", side); }

  void counter(const std::string& name, const char* help, std::initializer_list<Count> counts) {
    Metric& metric = metric_of(name + "_total", "counter", help);
    for (const auto& [labels, count] : counts) metric.add("", labels_of(labels), count);
  }
  void gauge(const char* name, const char* help, const std::string& labels, double value) {
    metric_of(name, "gauge", help).add("", labels_of(labels), number(value));
  }
  void histogram(const char* name, const char* help, const TimeHistogram& times) {
    Metric& metric = metric_of(name, "histogram", help);
    std::uint64_t count = 0;
    for (std::size_t i = 0; i < times.counts.size(); ++i) {
      count += times.counts[i];
      const bool is_last = i == TimeHistogram::kBounds_s.size();
      const std::string bound = is_last ? "+Inf" : number(TimeHistogram::kBounds_s[i]);
      metric.add("_bucket", labels_of(label("le", bound)), count);
    }
    metric.add("_sum", labels_of(""), number(times.sum_s));
    metric.add("_count", labels_of(""), count);
  }

  [[nodiscard]] std::string text() const {
    std::string page;
    for (const Metric& metric : metrics_) page += metric.head + metric.lines;
    return page;
  }

 private:
  struct Metric {
    std::string name;
    std::string head;
    std::string lines;

    void add(const char* suffix, const std::string& labels, const std::string& value) {
      lines += name + suffix + labels + " " + value + "\n";
    }
    void add(const char* suffix, const std::string& labels, std::uint64_t count) {
      add(suffix, labels, std::to_string(count));
    }
  };

  Metric& metric_of(const std::string& name, const char* type, const char* help) {
    const std::string full = "palpate_" + name;
    const auto known = std::find_if(metrics_.begin(), metrics_.end(),
                                    [&](const Metric& metric) { return metric.name == full; });
    if (known != metrics_.end()) return *known;
    return metrics_.emplace_back(
        Metric{.name = full,
               .head = "# HELP " + full + " " + help + "\n# TYPE " + full + " " + type + "\n",
               .lines = {}});
  }
  [[nodiscard]] std::string labels_of(const std::string& labels) const {
    const std::string all = side_ + (side_.empty() || labels.empty() ? "" : ",") + labels;
    return all.empty() ? "" : "{" + all + "}";
  }

  std::string side_;
  std::vector<Metric> metrics_;  // in the order in which they came first
};

void add_node(Page& page, const char* node, const NodeLink& link, TimePoint now) {
  const std::string labels = label("node", node);
  page.gauge("node_up", "Whether the node is heard.", labels, link.is_alive(now) ? 1 : 0);
  if (!link.is_heard()) return;
  page.counter("node_sessions", "Starts of the node, as heard.", {{labels, link.sessions}});
  page.counter("telemetry_batches_lost", "Batches of telemetry that did not arrive.",
               {{labels, link.batches_lost}});
  page.counter("telemetry_records_lost", "Ticks that the node could not keep.",
               {{labels, link.records_lost}});
  page.counter("peers_refused", "Connections that failed for want of the right keys.",
               {{labels, link.peers_refused}});
}

void add_loop(Page& page, const char* node, const LoopCounters& loop) {
  const std::string labels = label("node", node);
  page.counter("loop_ticks", "Turns of the periodic loop.", {{labels, loop.ticks}});
  page.counter("loop_skipped_ticks", "Turns missed by overruns.", {{labels, loop.skipped_ticks}});
  page.gauge("loop_worst_lateness_seconds", "Latest wake-up since the start.", labels,
             to_seconds(loop.worst_lateness));
}

void add_link(Page& page, const char* link, const LinkCounters& counters) {
  const auto with = [&](const char* result) {
    return label("link", link) + "," + label("result", result);
  };
  page.counter("link_messages", "Messages that arrived on a link, by what became of them.",
               {{with("accepted"), counters.accepted},
                {with("skipped"), counters.skipped},
                {with("duplicate"), counters.duplicates},
                {with("out_of_order"), counters.out_of_order},
                {with("rejected"), counters.rejected}});
}

void add_device(Page& page, const DeviceCounters& c) {
  add_loop(page, "device", c.loop);
  add_link(page, "force_command", c.force_command);
  page.counter("device_ticks", "Ticks by what the motors did.",
               {{label("force", "answered"), c.answered_ticks},
                {label("force", "leased"), c.leased_ticks},
                {label("force", "fallback"), c.fallback_ticks},
                {label("force", "limp"), c.limp_ticks},
                {label("force", "fault"), c.fault_ticks}});
  page.counter("device_peak_limited_ticks", "Ticks at the device's force limit.",
               {{"", c.peak_limited_ticks}});
  page.counter("device_faults", "Faults that were latched.", {{"", c.device_faults}});
  page.counter("device_fault_resets", "Faults that were reset.", {{"", c.fault_resets}});
  page.counter("device_non_finite_commands", "Answers with NaN or infinity, not rendered.",
               {{"", c.non_finite_commands}});
  page.counter("device_late_switches",
               "Answers that began to act after the deadline and were withdrawn at once.",
               {{"", c.late_switches}});
  page.gauge("device_max_force_newtons", "Greatest force since the start.", "", c.max_force_newton);
  page.gauge("device_minimum_true_energy_joules",
             "Least energy the hand has given, since the start; simulated devices only.", "",
             c.minimum_true_energy_joule);
}

void add_mofc(Page& page, const MofcCounters& c) {
  add_link(page, "device_state", c.device_state);
  add_link(page, "interaction", c.interaction);
  page.counter("mofc_ticks", "DeviceStates answered.", {{"", c.ticks}});
  page.counter("mofc_ticks_in", "Of these, in each condition.",
               {{label("condition", "contact"), c.contact_ticks},
                {label("condition", "clamped"), c.clamped_ticks},
                {label("condition", "too_fast"), c.too_fast_ticks},
                {label("condition", "stale"), c.stale_ticks},
                {label("condition", "late_physics"), c.late_physics_ticks}});
  page.counter("mofc_ledger_resets", "Energy ledgers begun anew.", {{"", c.ledger_resets}});
  page.counter("mofc_motions_dropped", "Motions that the link to physics did not take.",
               {{"", c.motions_dropped}});
  page.counter("mofc_motions_suppressed", "Motions within the deadband, not sent.",
               {{"", c.motions_suppressed}});
  page.gauge("mofc_transparency_ratio", "Force applied against force asked, mean.", "",
             c.transparency_samples > 0
                 ? c.transparency_sum / static_cast<double>(c.transparency_samples)
                 : kNaN);
}

void add_physics(Page& page, const PhysicsCounters& c) {
  add_loop(page, "physics", c.loop);
  add_link(page, "tool_motion", c.tool_motion);
  page.counter("physics_contact_steps", "Steps with the tool in contact.", {{"", c.contact_steps}});
  page.counter("physics_tissues", "Tissues looked at or skipped, summed over steps.",
               {{label("result", "visited"), c.tissues_visited},
                {label("result", "skipped"), c.tissues_skipped}});
  page.counter("physics_octree_cells_visited", "Cells of point clouds, summed over steps.",
               {{"", c.octree_cells_visited}});
  page.counter("physics_octree_last_cell_hits", "Nearest points found where the last one was.",
               {{"", c.octree_last_cell_hits}});
  page.counter("physics_tissues_asleep", "Tissues that relax, at rest, summed over steps.",
               {{"", c.tissues_asleep}});
  page.counter("physics_surfaces_shared", "Tissues whose file another had loaded.",
               {{"", c.surfaces_shared}});
  page.counter("physics_interactions_suppressed", "Interactions within the deadband, not sent.",
               {{"", c.interactions_suppressed}});
  page.counter("physics_mesh_frames", "Frames of tissue made for viewers.", {{"", c.mesh_frames}});
  page.counter("physics_meshes_skipped", "Times that frames were due and nobody looked on.",
               {{"", c.meshes_skipped}});
  page.gauge("physics_worst_compute_time_seconds", "Longest step since the start.", "",
             to_seconds(c.worst_compute_time));
}

}  // namespace

void TimeHistogram::add(Duration time) noexcept {
  const double s = to_seconds(time);
  const auto* bound = std::lower_bound(kBounds_s.begin(), kBounds_s.end(), s);
  ++counts[static_cast<std::size_t>(bound - kBounds_s.begin())];
  sum_s += s;
}

MetricsText::MetricsText(const Session& session) : times_(session.sides.size()) {
  for (const Side& side : session.sides) sides_.push_back(side.name);
}

void MetricsText::note(std::size_t side, const DeviceBatch& batch) noexcept {
  for (const DeviceTick& tick : batch.records) {
    times_[side].lateness.add(tick.lateness);
    if (tick.is_answered) times_[side].reply_time.add(tick.reply_time);
  }
}

void MetricsText::note(std::size_t side, const MofcBatch& batch) noexcept {
  for (const MofcTick& tick : batch.records) {
    if (tick.state == MofcState::kContact) times_[side].force_age.add(tick.force_age);
  }
}

void MetricsText::note(std::size_t side, const PhysicsBatch& batch) noexcept {
  for (const PhysicsTick& tick : batch.records) times_[side].compute_time.add(tick.compute_time);
}

std::string MetricsText::text(std::span<const TelemetryMirror> mirrors, const ViewerCounts& viewer,
                              TimePoint now) const {
  Page page;
  for (std::size_t i = 0; i < sides_.size(); ++i) {
    const TelemetryMirror& mirror = mirrors[i];
    page.begin_side(sides_[i]);
    add_node(page, "device", mirror.device_link(), now);
    add_node(page, "mofc", mirror.mofc_link(), now);
    add_node(page, "physics", mirror.physics_link(), now);
    if (mirror.device_link().is_heard()) add_device(page, mirror.device_counters());
    if (mirror.mofc_link().is_heard()) add_mofc(page, mirror.mofc_counters());
    if (mirror.physics_link().is_heard()) add_physics(page, mirror.physics_counters());

    const Times& times = times_[i];
    page.histogram("reply_time_seconds", "From the device's reading to its answer.",
                   times.reply_time);
    page.histogram("tick_lateness_seconds", "Of the device's wake-up.", times.lateness);
    page.histogram("force_age_seconds",
                   "From the reading that physics answers to its use, in contact.",
                   times.force_age);
    page.histogram("physics_compute_time_seconds", "Of a physics step.", times.compute_time);
  }

  page.begin_side("");
  page.gauge("viewer_clients", "WebSockets open.", "", viewer.clients);
  page.counter("viewer_messages_dropped", "Messages not sent to slow clients.",
               {{"", viewer.messages_dropped}});
  page.counter("viewer_requests_refused", "Requests and connections refused.",
               {{"", viewer.requests_refused}});
  page.counter("viewer_frames_rejected", "Telemetry that could not be read.",
               {{"", viewer.frames_rejected}});
  return page.text();
}

}  // namespace palpate::viewer
