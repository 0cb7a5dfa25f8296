// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/run_figures.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <variant>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "viewer_node/recording/recording_copy.h"

namespace palpate {
namespace {

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

/// Calls visit(fields of a, b and c) for what counts since the start of device_node.
template <class Visit>
void for_each_count(DeviceCounters& a, const DeviceCounters& b, const DeviceCounters& c,
                    const Visit& visit) {
  visit(a.loop.ticks, b.loop.ticks, c.loop.ticks);
  visit(a.loop.skipped_ticks, b.loop.skipped_ticks, c.loop.skipped_ticks);
  for (std::uint64_t DeviceCounters::*const field :
       {&DeviceCounters::answered_ticks,       &DeviceCounters::leased_ticks,
        &DeviceCounters::fallback_ticks,       &DeviceCounters::limp_ticks,
        &DeviceCounters::peak_limited_ticks,   &DeviceCounters::fault_ticks,
        &DeviceCounters::device_faults,        &DeviceCounters::fault_resets,
        &DeviceCounters::non_finite_commands,  &DeviceCounters::late_switches,
        &DeviceCounters::monitor_reductions,   &DeviceCounters::ledger_excesses,
        &DeviceCounters::too_fast_readings,    &DeviceCounters::coarse_readings,
        &DeviceCounters::outside_readings,     &DeviceCounters::dead_man_ticks,
        &DeviceCounters::frozen_ticks,         &DeviceCounters::start_up_ticks,
        &DeviceCounters::repeated_readings,    &DeviceCounters::uncalibrated_ticks,
        &DeviceCounters::unacknowledged_ticks, &DeviceCounters::checking_ticks}) {
    visit(a.*field, b.*field, c.*field);
  }
}
template <class Visit>
void for_each_count(MofcCounters& a, const MofcCounters& b, const MofcCounters& c,
                    const Visit& visit) {
  for (std::uint64_t MofcCounters::*const field :
       {&MofcCounters::ticks, &MofcCounters::contact_ticks, &MofcCounters::clamped_ticks,
        &MofcCounters::too_fast_ticks, &MofcCounters::stale_ticks,
        &MofcCounters::late_physics_ticks, &MofcCounters::ledger_resets,
        &MofcCounters::disturbed_contact_ticks, &MofcCounters::disturbed_clamped_ticks,
        &MofcCounters::motions_dropped, &MofcCounters::motions_suppressed,
        &MofcCounters::transparency_time_ns, &MofcCounters::standby_ticks,
        &MofcCounters::physics_switches, &MofcCounters::grips, &MofcCounters::grips_torn,
        &MofcCounters::grips_slipped, &MofcCounters::punctures, &MofcCounters::debt_ticks}) {
    visit(a.*field, b.*field, c.*field);
  }
  visit(a.transparency_integral_ns, b.transparency_integral_ns, c.transparency_integral_ns);
}

/// A publisher reads the counters before it takes the records, among which there may be a later
/// tick.
std::uint64_t ticks_of(const DeviceBatch& batch) {
  return batch.records.empty() ? batch.counters.loop.ticks : batch.records.back().sequence + 1;
}
std::uint64_t ticks_of(const MofcBatch& batch) { return batch.counters.ticks; }
void set_ticks(DeviceCounters& counters, std::uint64_t ticks) { counters.loop.ticks = ticks; }
void set_ticks(MofcCounters& counters, std::uint64_t ticks) { counters.ticks = ticks; }

/// The counts before the first batch that was received: what its own ticks have not made. Of a
/// batch from the start of a node nothing.
DeviceCounters counts_before(const DeviceBatch& batch) {
  const std::uint64_t ticks = batch.records.size();
  if (ticks_of(batch) <= ticks) return {};
  DeviceCounters before = batch.counters;
  before.loop.ticks = ticks_of(batch) - ticks;
  const auto take = [](std::uint64_t& count) { count -= std::min<std::uint64_t>(count, 1); };
  for (const DeviceTick& tick : batch.records) {
    if (tick.is_answered) take(before.answered_ticks);
    if (before.answered_ticks == 0 && tick.guard == GuardState::kLimp) take(before.start_up_ticks);
    if (tick.guard == GuardState::kLeased) take(before.leased_ticks);
    if (tick.guard == GuardState::kLimp) take(before.limp_ticks);
    if (tick.guard == GuardState::kFault) take(before.fault_ticks);
    if (tick.guard == GuardState::kFallback || tick.guard == GuardState::kFading) {
      take(before.fallback_ticks);
    }
  }
  return before;
}
MofcCounters counts_before(const MofcBatch& batch) {
  const std::uint64_t ticks = batch.records.size();
  if (batch.counters.ticks <= ticks) return {};
  MofcCounters before = batch.counters;
  before.ticks -= ticks;
  const auto take = [](std::uint64_t& count) { count -= std::min<std::uint64_t>(count, 1); };
  for (const MofcTick& tick : batch.records) {
    if (tick.is_in_contact) take(before.contact_ticks);
    if (tick.is_clamped) take(before.clamped_ticks);
    if (tick.is_clamped && tick.ledger_energy_joule < 0.0) take(before.debt_ticks);
  }
  return before;
}

/// The first batch received has this number at least: who listens began in the middle of the run.
/// 30 … 60 are sent a second.
constexpr std::uint64_t kLateBatch = 60;

/// Adds what the batch counts beyond the one before it.
/// @return  false if the batch is known
template <class Batch, class Counters, class Known>
bool add_counts(const Batch& batch, bool is_part, Counters& total, Known& session) {
  const bool is_same = batch.header.session_id == session.id;
  if (is_same && batch.header.sequence <= session.batch) return false;  // late or twice
  const bool is_late = session.id == 0 && batch.header.sequence >= kLateBatch;
  const Counters before = is_same              ? session.newest
                          : is_part || is_late ? counts_before(batch)
                                               : Counters{};
  session = {
      .id = batch.header.session_id, .batch = batch.header.sequence, .newest = batch.counters};
  set_ticks(session.newest, ticks_of(batch));
  Counters sum = session.newest;
  for_each_count(sum, total, before, [](auto& count, const auto& earlier, const auto& known) {
    count = earlier + (count - known);
  });
  total = sum;
  return true;
}

}  // namespace

void RunFigures::add(const TickRow& row, const IdealState& ideal) {
  lateness.add(row.device.lateness);
  if (row.device.is_answered) reply_time.add(row.device.reply_time);
  statistics.add(row, ideal);
}

void RunFigures::add(const DeviceBatch& batch) {
  const DeviceCounters& newest = batch.counters;
  minimum_true_energy_joule =
      std::fmin(minimum_true_energy_joule, newest.minimum_true_energy_joule);
  max_force_newton = std::fmax(max_force_newton, newest.max_force_newton);
  largest_jump_newton = std::fmax(largest_jump_newton, newest.largest_jump_newton);
  const std::uint64_t longest_skip = device.longest_skip_ticks;
  add_counts(batch, is_part, device, device_session_);
  device.longest_skip_ticks = std::max(device.longest_skip_ticks, longest_skip);
}

void RunFigures::add(const MofcBatch& batch) {
  if (!add_counts(batch, is_part, mofc, mofc_session_)) return;
  for (const MofcTick& tick : batch.records) {
    if (tick.state == MofcState::kClutched) ++clutched_ticks;
  }
}

/// Time and steps between the first and the newest step of each session.
void RunFigures::add(const PhysicsBatch& batch) {
  for (const PhysicsTick& tick : batch.records) {
    const bool is_same = batch.header.session_id == physics_session_;
    if (is_same && tick.sequence <= physics_sequence_) continue;  // late or twice
    if (is_same) {
      const std::uint64_t steps = tick.sequence - physics_sequence_;
      const Duration since = tick.stepped_at - physics_stepped_at_;
      // telemetry of the steps before the gap may be lost
      const Duration of_others = steps == 1 || physics_steps == 0
                                     ? Duration::zero()
                                     : from_seconds(static_cast<double>(steps - 1) / physics_hz());
      if (steps == 1 || physics_steps > 0) physics_gap = std::max(physics_gap, since - of_others);
      physics_steps += steps;
      physics_time += since;
    }
    ++physics_received_;
    physics_compute_ += tick.compute_time;
    physics_session_ = batch.header.session_id;
    physics_sequence_ = tick.sequence;
    physics_stepped_at_ = tick.stepped_at;
  }
}

double RunFigures::physics_hz() const {
  return physics_time.count() > 0 ? static_cast<double>(physics_steps) / to_seconds(physics_time)
                                  : kNaN;
}

double RunFigures::physics_busy_ratio() const {
  return physics_hz() * to_seconds(physics_compute_) / static_cast<double>(physics_received_);
}

RunFacts facts_of(RunFacts about, const viewer::TelemetryMirror& mirror,
                  const RunFigures& figures) {
  const auto node = [](const viewer::NodeLink& link) {
    return RunFacts::Node{.is_heard = link.is_heard(),
                          .restarts = link.sessions > 0 ? link.sessions - 1 : 0,
                          .peers_refused = link.peers_refused};
  };
  about.device_node = node(mirror.device_link());
  about.mofc_node = node(mirror.mofc_link());
  about.physics_node = node(mirror.physics_link());
  about.device = figures.device;
  about.mofc = figures.mofc;
  about.physics = mirror.physics_counters();
  if (about.mofc.standby_interaction.sessions > 0) {  // both speak on one link
    const std::uint64_t sessions = about.mofc.interaction.sessions;
    about.physics_node.restarts = sessions > 0 ? sessions - 1 : 0;
  } else {
    about.physics_hz = figures.physics_hz();
    about.physics_gap_s = to_seconds(figures.physics_gap);
    about.physics_gap_ratio = about.physics_gap_s / to_seconds(figures.physics_time);
    about.physics_busy_ratio = figures.physics_busy_ratio();
  }
  if (!about.is_in_real_time) {  // where a physics is restarted only for mofc_node
    const std::uint64_t sessions = about.mofc.interaction.sessions;
    about.physics_node.restarts = sessions > 0 ? sessions - 1 : 0;
  }
  about.clutched_ticks = figures.clutched_ticks;
  const RunStatistics& received = figures.statistics;
  about.ticks_received = received.ticks();
  about.minimum_true_energy_joule = figures.minimum_true_energy_joule;
  about.maximum_force_newton = figures.max_force_newton;
  about.force_error_rms_ratio = received.force_error_rms_ratio();
  about.beyond_jnd_ratio = received.beyond_jnd_ratio();
  if (std::isfinite(received.path_deviation_rms_m())) {
    about.excess_reversals = received.excess_reversals();
  }
  return about;
}

RunFacts facts_of(const RecordingFile& recording, const RecordedRun& run) {
  const std::string side = recording.side();
  RunFacts about;
  about.controller = controller_of(recording, side);
  about.is_limited =
      about.controller.starts_with("mofc") || about.controller.ends_with("behind guard");
  const std::string file = recording.about("session_file");
  try {
    const Session session = with_only_side(
        parse_session(recording.about("session"), file, {}, folder_of_session(recording)), side);
    about = facts_of(session, session.side());
  } catch (const SetupError&) {  // of another version, or its files are not here
  }
  about.is_in_real_time = !is_of_lockstep(recording);
  RunFacts facts = facts_of(std::move(about), run.mirror, run.figures);
  leave_out_runs(facts, viewer::seams_of(recording.mcap()).size());
  const auto is_recorded = [&](const char* name) {
    const auto& topics = recording.mcap().topics();
    return std::any_of(topics.begin(), topics.end(),
                       [&](const auto& one) { return one.topic == name; });
  };
  facts.device_node.is_recorded = is_recorded("/device");
  facts.mofc_node.is_recorded = is_recorded("/mofc");
  facts.physics_node.is_recorded = is_recorded("/physics");
  return facts;
}

void leave_out_runs(RunFacts& facts, std::uint64_t others) {
  for (RunFacts::Node* node : {&facts.device_node, &facts.mofc_node, &facts.physics_node}) {
    node->restarts -= std::min(node->restarts, others);
  }
}

std::string controller_of(const RecordingFile& recording, const std::string& side) {
  std::string all = recording.about("controller");
  const std::size_t begin = side.empty() ? 0 : all.find(side + ": ");
  if (side.empty() || begin == std::string::npos) return all;
  const std::size_t text = begin + side.size() + 2;
  std::size_t end = all.size();
  for (const std::string& other : recording.sides()) {
    end = std::min(end, all.find(", " + other + ": ", text));
  }
  return all.substr(text, end - text);
}

nlohmann::ordered_json figures_json(const std::string& controller,
                                    const viewer::TelemetryMirror& mirror,
                                    const RunFigures& figures) {
  const DeviceCounters& device = figures.device;
  const MofcCounters& mofc = figures.mofc;
  const PhysicsCounters& physics = mirror.physics_counters();
  const RunStatistics& received = figures.statistics;
  nlohmann::ordered_json json;
  json["controller"] = controller;
  json["ticks"] = device.loop.ticks;
  json["skipped_ticks"] = device.loop.skipped_ticks;
  json["in_contact_ticks"] = mofc.contact_ticks;
  json["transparency"] = {{"vector", number_or_null(mofc.transparency())},
                          {"ideal", number_or_null(received.ideal_transparency())}};
  json["gain"] = number_or_null(received.gain());
  json["min_true_energy_j"] = number_or_null(figures.minimum_true_energy_joule);
  json["max_force_n"] = figures.max_force_newton;
  json["largest_jump_n"] = figures.largest_jump_newton;
  json["monitor"] = device.is_monitor_off ? "off" : "on";
  json["monitor_reductions"] = device.monitor_reductions;
  json["ledger_excesses"] = device.ledger_excesses;
  json["has_motor_watchdog"] = !device.has_no_motor_watchdog;
  json["accepts_no_motor_watchdog"] = device.accepts_no_motor_watchdog;
  json["clamped_ticks"] = mofc.clamped_ticks;
  json["debt_ticks"] = mofc.debt_ticks;
  json["clamp_ratio"] = number_or_null(ratio(mofc.clamped_ticks, mofc.contact_ticks));
  json["answered_ratio"] = number_or_null(answered_ratio(device));
  json["motions_suppressed"] = mofc.motions_suppressed;
  json["physics_term"] = mofc.physics_term;
  json["standby_ticks"] = mofc.standby_ticks;
  json["physics_switches"] = mofc.physics_switches;
  json["grips"] = mofc.grips;
  json["grips_torn"] = mofc.grips_torn;
  json["grips_slipped"] = mofc.grips_slipped;
  json["punctures"] = mofc.punctures;
  json["interactions_suppressed"] = physics.interactions_suppressed;
  json["elastic"] = elastic_json(physics);
  json["mesh_frames"] = physics.mesh_frames;
  json["meshes_skipped"] = physics.meshes_skipped;
  json["physics_hz"] = number_or_null(figures.physics_hz());
  json["device_faults"] = device.device_faults;
  json["last_fault"] = name(device.last_fault);
  json["fault_ticks"] = device.fault_ticks;
  json["fallbacks"] = device.fallback_ticks + device.limp_ticks;
  json["start_up_ticks"] = device.start_up_ticks;
  json["waiting_ticks"] = {{"uncalibrated", device.uncalibrated_ticks},
                           {"unacknowledged", device.unacknowledged_ticks},
                           {"checking", device.checking_ticks}};
  json["repeated_readings"] = device.repeated_readings;
  json["longest_skip_ticks"] = device.longest_skip_ticks;
  json["reply_time"] = percentiles_json(figures.reply_time);
  json["lateness"] = percentiles_json(figures.lateness);
  json["received"] = {{"ticks", received.ticks()},
                      {"transparency", number_or_null(received.vector_transparency())},
                      {"clamp_ratio", number_or_null(received.clamp_ratio())}};
  return json;
}

std::vector<std::pair<std::string, std::string>> figure_lines(const std::string& controller,
                                                              const viewer::TelemetryMirror& mirror,
                                                              const RunFigures& figures) {
  const DeviceCounters& device = figures.device;
  const MofcCounters& mofc = figures.mofc;
  std::vector<std::pair<std::string, std::string>> lines;
  const auto line = [&](const char* label, std::string value) {
    lines.emplace_back(label, std::move(value));
  };
  line("in contact", fmt::format("{} of {} ticks", mofc.contact_ticks, mofc.ticks));
  if (!controller.starts_with("none")) {
    std::string clamped = fmt::format("{} ticks", mofc.clamped_ticks);
    if (mofc.debt_ticks > 0) {
      clamped += fmt::format(", {} of them to what friction bears, in debt", mofc.debt_ticks);
    }
    line("clamped by MOFC", std::move(clamped));
  }
  line("transparency", figure(mofc.transparency(), "{:.3f}") + " (rendered / requested force)");
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
         energy_text(figures.minimum_true_energy_joule) + " (0 or more: passive)");
  }
  if (mofc.standby_interaction.sessions > 0) line("physics", speaker_text(mofc));
  if (std::string elastic = elastic_text(mirror.physics_counters()); !elastic.empty()) {
    line("elastic tissue", std::move(elastic));
  }
  if (device.device_faults > 0) {
    line("device fault",
         fmt::format("{}, {} ticks without force", name(device.last_fault), device.fault_ticks));
  }
  line("answered in time",
       figure(100.0 * answered_ratio(device), "{:.3f} %") +
           fmt::format(" of {} scheduled ticks ({} skipped)",
                       device.loop.ticks + device.loop.skipped_ticks, device.loop.skipped_ticks));
  line("telemetry",
       fmt::format("{} of {} ticks received", figures.statistics.ticks(), device.loop.ticks));
  line("reply time", percentiles_text(figures.reply_time) + " of the ticks received");
  line("tick lateness", percentiles_text(figures.lateness) + " of the ticks received");
  line("without an answer",
       fmt::format("{} ticks on the lease, {} in fallback, {} limp ({} before the first answer)",
                   device.leased_ticks, device.fallback_ticks, device.limp_ticks,
                   device.start_up_ticks));
  if (device.repeated_readings > 0) {
    line("repeated readings",
         fmt::format("{} of {} ticks", device.repeated_readings, device.loop.ticks));
  }
  return lines;
}

void read_run(RecordingFile& recording, RecordedRun& run,
              const std::function<void(const TickRow&)>& on_row,
              const std::function<void(const RecordingFile::Item&)>& on_item) {
  run.mirror.on_row = [&](TickRow row) {
    recording.complete(row);
    run.figures.add(row, recording.ideal_of(row));
    if (on_row) on_row(row);
  };
  run.figures.is_part = !recording.mcap().metadata(viewer::kCopyMetadata).empty();
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    const TimePoint at{Duration(static_cast<std::int64_t>(item->log_time_ns))};
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { run.mirror.take(message, at); }) run.mirror.take(message, at);
        },
        item->message);
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { message.counters; }) run.figures.add(message);
        },
        item->message);
    if (on_item) on_item(*item);
  }
  run.mirror.flush_rows();
  run.mirror.on_row = {};
}

}  // namespace palpate
