// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/metrics_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <unordered_map>

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

/// Collects metrics side by side; groups all lines of one metric under its head.
class Page {
 public:
  /// Side of the following lines; "" for none.
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
    const auto [known, is_new] = place_of_.emplace(full, metrics_.size());
    if (!is_new) return metrics_[known->second];
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
  std::vector<Metric> metrics_;                            // in order of first use
  std::unordered_map<std::string, std::size_t> place_of_;  // there, by name
};

void add_node(Page& page, const char* node, const NodeLink& link, TimePoint now) {
  const std::string labels = label("node", node);
  page.gauge("node_up", "1 if the node sends telemetry, else 0.", labels,
             link.is_alive(now) ? 1 : 0);
  if (!link.is_heard()) return;
  page.counter("node_sessions", "Process starts of the node seen by this viewer.",
               {{labels, link.sessions}});
  page.counter("telemetry_batches_lost", "Telemetry batches lost between node and viewer.",
               {{labels, link.batches_lost}});
  page.counter("telemetry_records_lost", "Ticks that the node could not buffer.",
               {{labels, link.records_lost}});
  page.counter("peers_refused", "Connections refused for lack of the right keys.",
               {{labels, link.peers_refused}});
}

void add_loop(Page& page, const char* node, const LoopCounters& loop) {
  const std::string labels = label("node", node);
  page.counter("loop_ticks", "Ticks of the periodic loop.", {{labels, loop.ticks}});
  page.counter("loop_skipped_ticks", "Ticks missed because of overruns.",
               {{labels, loop.skipped_ticks}});
  page.gauge("loop_worst_lateness_seconds", "Largest lateness of a tick since the start.", labels,
             to_seconds(loop.worst_lateness));
}

void add_link(Page& page, const char* link, const LinkCounters& counters) {
  const auto with = [&](const char* result) {
    return label("link", link) + "," + label("result", result);
  };
  page.counter("link_messages", "Messages received on a link, by result.",
               {{with("accepted"), counters.accepted},
                {with("skipped"), counters.skipped},
                {with("duplicate"), counters.duplicates},
                {with("out_of_order"), counters.out_of_order},
                {with("rejected"), counters.rejected},
                {with("ahead"), counters.ahead}});
}

void add_device(Page& page, const DeviceCounters& c) {
  add_loop(page, "device", c.loop);
  add_link(page, "force_command", c.force_command);
  page.counter("device_ticks", "Ticks by origin of the applied force.",
               {{label("force", "answered"), c.answered_ticks},
                {label("force", "leased"), c.leased_ticks},
                {label("force", "fallback"), c.fallback_ticks},
                {label("force", "limp"), c.limp_ticks},
                {label("force", "fault"), c.fault_ticks}});
  page.counter("device_start_up_ticks", "Ticks without a force before the first answer.",
               {{"", c.start_up_ticks}});
  page.counter("device_repeated_readings",
               "Readings with the stamp of the reading of the tick before.",
               {{"", c.repeated_readings}});
  page.counter("device_peak_limited_ticks", "Ticks at the device's force limit.",
               {{"", c.peak_limited_ticks}});
  page.counter("device_faults", "Latched faults.", {{"", c.device_faults}});
  page.counter("device_fault_resets", "Fault resets.", {{"", c.fault_resets}});
  page.counter("device_non_finite_commands", "Answers with NaN or infinity, not applied.",
               {{"", c.non_finite_commands}});
  page.counter("device_late_switches",
               "Answers that began to act after the deadline and were withdrawn at once.",
               {{"", c.late_switches}});
  page.gauge("device_monitor_up", "1: the monitor of the energy is on.", "",
             c.is_monitor_off ? 0.0 : 1.0);
  page.counter("device_monitor_reductions", "Commands that the monitor of the energy reduced.",
               {{"", c.monitor_reductions}});
  page.counter("device_ledger_excesses",
               "Answers of a clamp that counts on more energy than the hand can have put in.",
               {{"", c.ledger_excesses}});
  page.counter("device_assumption_violations",
               "Readings that contradict an assumption of the guarantee.",
               {{label("assumption", "hand_speed"), c.too_fast_readings},
                {label("assumption", "resolution"), c.coarse_readings},
                {label("assumption", "workspace"), c.outside_readings}});
  page.gauge("device_checked_friction_ratio",
             "Friction found by the hands-off check, as a share of the profile; 0: no check.", "",
             c.checked_friction_ratio);
  page.gauge(
      "device_motor_watchdog_up",
      "1: the motors end a force by themselves if the process stops; 0: they do not, and the "
      "guarantee is not available while it is stopped.",
      "", c.has_no_motor_watchdog ? 0.0 : 1.0);
  page.gauge("device_accepts_no_motor_watchdog",
             "1: the session accepts forces above f_co from motors that end none by themselves.",
             "", c.accepts_no_motor_watchdog ? 1.0 : 0.0);
  page.gauge(
      "device_phase",
      "1 closed, 2 connected, 3 calibrated, 4 enabled (forces act), 5 faulted, 6 its motors are "
      "checked; 0 unknown.",
      "", static_cast<double>(c.phase));
  page.gauge("device_release_unconfirmed",
             "1: the device has not confirmed its last release, and may still push.", "",
             c.is_release_unconfirmed ? 1.0 : 0.0);
  page.counter("device_page_acknowledgements",
               "By a person at a page; refused: the device was not as the page had shown it.",
               {{label("result", "taken"), c.page_acknowledgements},
                {label("result", "refused"), c.page_acknowledgements_refused}});
  page.counter("device_dead_man_ticks", "Ticks in which the dead-man button was not held.",
               {{"", c.dead_man_ticks}});
  page.counter("device_waiting_ticks", "Ticks without force after the first answer: it waited.",
               {{label("for", "calibration"), c.uncalibrated_ticks},
                {label("for", "acknowledgement"), c.unacknowledged_ticks},
                {label("for", "motor_check"), c.checking_ticks}});
  page.gauge("device_max_force_newtons", "Largest force since the start.", "", c.max_force_newton);
  page.gauge("device_largest_jump_newtons",
             "Largest change of the force from one tick to the next since the start.", "",
             c.largest_jump_newton);
  page.gauge("device_minimum_true_energy_joules",
             "Minimum of the true energy since the start; simulated devices only.", "",
             c.minimum_true_energy_joule);
}

void add_mofc(Page& page, const MofcCounters& c) {
  add_link(page, "device_state", c.device_state);
  add_link(page, "interaction", c.interaction);
  add_link(page, "standby_interaction", c.standby_interaction);
  page.counter("mofc_ticks", "DeviceStates answered.", {{"", c.ticks}});
  page.counter("mofc_ticks_in", "Of these, ticks in each condition.",
               {{label("condition", "contact"), c.contact_ticks},
                {label("condition", "clamped"), c.clamped_ticks},
                {label("condition", "debt"), c.debt_ticks},
                {label("condition", "too_fast"), c.too_fast_ticks},
                {label("condition", "stale"), c.stale_ticks},
                {label("condition", "late_physics"), c.late_physics_ticks},
                {label("condition", "standby"), c.standby_ticks}});
  page.gauge("mofc_physics_term", "Term of the physics that speaks; odd: the standby.", "",
             static_cast<double>(c.physics_term));
  page.counter("mofc_physics_switches", "Switches between the physics and its standby.",
               {{"", c.physics_switches}});
  page.counter("mofc_grips", "Closings of the jaws that took hold of tissue, and how they lost it.",
               {{label("result", "held"), c.grips},
                {label("result", "torn"), c.grips_torn},
                {label("result", "slipped"), c.grips_slipped}});
  page.counter("mofc_punctures", "Insertions of a needle into elastic tissue.",
               {{"", c.punctures}});
  page.counter("mofc_ledger_resets", "Resets of the energy ledger.", {{"", c.ledger_resets}});
  page.counter("mofc_motions_dropped", "Motions that the link to physics refused.",
               {{"", c.motions_dropped}});
  page.counter("mofc_motions_suppressed", "Motions within the deadband, not sent.",
               {{"", c.motions_suppressed}});
  page.gauge("mofc_transparency_ratio",
             "Mean over time of the ratio of rendered to requested force, projected and capped.",
             "", c.transparency());
}

void add_physics(Page& page, const PhysicsCounters& c) {
  add_loop(page, "physics", c.loop);
  add_link(page, "tool_motion", c.tool_motion);
  page.counter("physics_contact_steps", "Steps with the tool in contact.", {{"", c.contact_steps}});
  page.counter("physics_tissues",
               "Tissues visited or skipped by the broad phase, summed over steps.",
               {{label("result", "visited"), c.tissues_visited},
                {label("result", "skipped"), c.tissues_skipped}});
  page.counter("physics_octree_cells_visited", "Cells of point clouds, summed over steps.",
               {{"", c.octree_cells_visited}});
  page.counter("physics_octree_last_cell_hits",
               "Nearest points in the same octree cell as the previous one.",
               {{"", c.octree_last_cell_hits}});
  page.counter("physics_tissues_asleep",
               "Viscoelastic tissues at rest and not advanced, summed over steps.",
               {{"", c.tissues_asleep}});
  page.counter("physics_surfaces_shared", "Tissues that share the file of an earlier tissue.",
               {{"", c.surfaces_shared}});
  page.counter("physics_interactions_suppressed", "Interactions within the deadband, not sent.",
               {{"", c.interactions_suppressed}});
  page.counter("physics_mesh_frames", "Mesh frames computed for viewers.", {{"", c.mesh_frames}});
  page.counter("physics_meshes_skipped",
               "Mesh frames due but not computed for lack of a subscriber.",
               {{"", c.meshes_skipped}});
  page.counter("physics_tissue_changes", "Changes of stiffness and damping applied.",
               {{"", c.tissue_changes}});
  page.counter("physics_tissue_changes_refused", "Changes of stiffness and damping refused.",
               {{"", c.tissue_changes_refused}});
  page.counter("physics_elastic_solves", "Full solutions of elastic bodies.",
               {{label("result", "made"), c.elastic_solves},
                {label("result", "skipped"), c.elastic_solves_skipped},
                {label("result", "late"), c.elastic_solves_late},
                {label("result", "failed"), c.elastic_solves_failed},
                {label("result", "repaired"), c.elastic_solves_repaired}});
  page.counter("physics_elastic_tips_appeared", "Tools that appeared inside an elastic body.",
               {{"", c.elastic_tips_appeared}});
  page.gauge("physics_elastic_points_held", "Points of elastic bodies in the jaws of tools.", "",
             static_cast<double>(c.elastic_points_held));
  page.counter("physics_elastic_energised_steps", "Steps with the electrode on.",
               {{"", c.elastic_energised_steps}});
  page.counter("physics_elastic_bodies_remade", "Elastic bodies replaced after an ablation.",
               {{label("result", "made"), c.elastic_bodies_remade},
                {label("result", "refused"), c.elastic_bodies_refused},
                {label("result", "restored"), c.elastic_bodies_restored}});
  page.counter("physics_elastic_elements_removed", "Elements that vanished from elastic bodies.",
               {{label("cause", "ablated"), c.elastic_elements_removed - c.elastic_elements_loose},
                {label("cause", "loose"), c.elastic_elements_loose}});
  page.counter("physics_elastic_attachments_torn", "Points torn off what they were attached to.",
               {{"", c.elastic_attachments_torn}});
  page.counter("physics_elastic_faces_cut", "Faces between elements that blades have separated.",
               {{"", c.elastic_faces_cut}});
  page.counter("physics_elastic_steps_skipped", "Steps out of reach of an elastic body.",
               {{"", c.elastic_steps_skipped}});
  page.gauge("physics_elastic_residual_ratio",
             "Unbalanced force of the last full solution over all its forces.", "",
             c.elastic_residual_ratio);
  page.gauge("physics_elastic_error_newton",
             "Measured error of the condensed model at the last full solution in contact; NaN: "
             "unknown.",
             "", c.elastic_error_newton);
  page.gauge("physics_elastic_bound_newton",
             "Stated bound of that error at the last step in contact; NaN: unknown.", "",
             c.elastic_bound_newton);
  page.counter("physics_elastic_bounds",
               "Measured errors for whose place a bound was stated, by the result.",
               {{label("result", "kept"), c.elastic_bounds_checked - c.elastic_bound_violations},
                {label("result", "exceeded"), c.elastic_bound_violations}});
  page.counter(
      "physics_elastic_contact_steps",
      "Steps in contact with an elastic body, by whether the error of its force is bounded.",
      {{label("bound", "known"), c.elastic_contact_steps - c.elastic_unknown_bound_steps},
       {label("bound", "unknown"), c.elastic_unknown_bound_steps}});
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
    page.histogram("reply_time_seconds", "Time from sending the device state to its answer.",
                   times.reply_time);
    page.histogram("tick_lateness_seconds", "Lateness of the device's tick.", times.lateness);
    page.histogram("force_age_seconds",
                   "Age of the device state behind the requested force, in contact.",
                   times.force_age);
    page.histogram("physics_compute_time_seconds", "Computing time of a physics step.",
                   times.compute_time);
  }

  page.begin_side("");
  page.gauge("viewer_clients", "Connected WebSocket clients.", "", viewer.clients);
  page.counter("viewer_messages_dropped", "Messages dropped because a client read too slowly.",
               {{"", viewer.messages_dropped}});
  page.counter("viewer_messages_thinned",
               "Messages of an audience that a newer one replaced before the client read them.",
               {{"", viewer.messages_thinned}});
  page.counter("viewer_requests_refused", "Requests and connections refused.",
               {{"", viewer.requests_refused}});
  page.counter("viewer_frames_rejected", "Telemetry messages rejected by the codec.",
               {{"", viewer.frames_rejected}});
  return page.text();
}

}  // namespace palpate::viewer
