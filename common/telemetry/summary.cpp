// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/summary.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {
namespace {

/// Not finite where one of the two is unknown.
Vector3 deviation_m(const TickRow& row, const IdealState& ideal) {
  return row.device.true_tool_position_world_m - ideal.tool_position_world_m;
}

/// A force that is linear between two ticks.
struct Line {
  TimePoint from;
  TimePoint until;
  const Vector3& from_newton;
  const Vector3& until_newton;

  [[nodiscard]] Vector3 at(TimePoint time) const {
    const double share = to_seconds(time - from) / to_seconds(until - from);
    return from_newton + share * (until_newton - from_newton);
  }
};

/// What acted before a tick against that reference; nothing where it is unknown.
ForceComparison against(const Line& reference, const LastSwitch& before, const DeviceTick& tick) {
  ForceComparison comparison;
  if (!reference.from_newton.allFinite() || !reference.until_newton.allFinite()) return comparison;
  for_each_acted(before, tick, [&](TimePoint from, TimePoint until, const Vector3& acted) {
    comparison.add(to_seconds(until - from), reference.at(from), reference.at(until), acted);
  });
  return comparison;
}

}  // namespace

void RunStatistics::add(const TickRow& row, const IdealState& ideal) {
  const DeviceTick& device = row.device;
  const Vector3& fs = device.force_on_hand_newton;
  ++ticks_;

  // over the time since the previous row
  if (previous_ && previous_->device_session_id != row.device_session_id) requests_.interrupt();
  if (previous_ && (previous_->device_session_id != row.device_session_id ||
                    previous_->sequence + 1 != device.sequence)) {
    previous_.reset();
  }
  requests_.add(device, row.mofc);
  compare(row, ideal);

  // this tick
  if (row.mofc) {
    const bool is_torque_requested =  // without a wrist they are not numbers
        (row.mofc->requested_wrist_torque_newton_m.array().abs() > 0.0).any();
    if (is_torque_requested || !row.mofc->requested_force_on_hand_newton.isZero(0.0)) {
      ++requested_ticks_;
    }
    if (row.mofc->is_clamped) ++clamped_ticks_;
    if (row.mofc->state == MofcState::kClutched) ++clutched_ticks_;
  }
  const bool is_in_contact =
      row.is_truly_in_contact.value_or(row.mofc.has_value() && row.mofc->is_in_contact);
  if (is_in_contact) ++contact_ticks_;

  if (row.wrist_to_ideal) wrist_to_ideal_.add(*row.wrist_to_ideal);

  // safety
  maximum_force_newton_ = std::max(maximum_force_newton_, fs.norm());
  maximum_torque_newton_m_ =
      std::fmax(maximum_torque_newton_m_, device.wrist_torque_newton_m.cwiseAbs().maxCoeff());
  add_fallback(device);
  if (!std::isnan(device.minimum_true_energy_joule)) {
    minimum_true_energy_joule_ = device.minimum_true_energy_joule;
  }

  // the path, and the path of the ideal run
  if (device.true_tool_position_world_m.allFinite()) {
    top_tool_speed_m_per_s_ =
        std::max(top_tool_speed_m_per_s_, device.true_tool_velocity_world_m_per_s.norm());
    if (device.true_wrist_velocity_rad_per_s.allFinite()) {
      top_wrist_speed_rad_per_s_ = std::max(
          top_wrist_speed_rad_per_s_, device.true_wrist_velocity_rad_per_s.cwiseAbs().maxCoeff());
    }
    reversals_.add(device.true_tool_position_world_m);
    if (ideal.tool_position_world_m.allFinite()) {
      ideal_reversals_.add(ideal.tool_position_world_m);
      deviation_peak_m_ = std::fmax(deviation_peak_m_, deviation_m(row, ideal).norm());
    }
  }
  previous_ = {.device_session_id = row.device_session_id,
               .sequence = device.sequence,
               .sampled_at = device.sampled_at,
               .last_switch = {.at = device.switched_at, .force_newton = fs},
               .ideal_newton = row.ideal_force_on_hand_newton,
               .ideal_run_newton = ideal.force_on_hand_newton,
               .deviation_m = deviation_m(row, ideal)};
}

/// What acted since the previous row, and the path.
void RunStatistics::compare(const TickRow& row, const IdealState& ideal) {
  const DeviceTick& tick = row.device;
  const double elapsed_s = previous_ ? to_seconds(tick.sampled_at - previous_->sampled_at) : 0.0;
  const auto against_line = [&](const Vector3& before_newton, const Vector3& newton) {
    return against({previous_->sampled_at, tick.sampled_at, before_newton, newton},
                   previous_->last_switch, tick);
  };

  // against the ideal force: as the run compared them, or linear between both rows
  if (row.to_ideal) {
    add_to_ideal(*row.to_ideal, elapsed_s);
  } else if (elapsed_s > 0.0) {
    add_to_ideal(against_line(previous_->ideal_newton, row.ideal_force_on_hand_newton), elapsed_s);
  }
  if (!(elapsed_s > 0.0)) return;
  to_ideal_run_.add(against_line(previous_->ideal_run_newton, ideal.force_on_hand_newton));

  // ∫ |d|² dt of a deviation that is linear in time
  const Vector3& d0 = previous_->deviation_m;
  const Vector3 d1 = deviation_m(row, ideal);
  if (d0.allFinite() && d1.allFinite()) {
    deviation_s_ += elapsed_s;
    deviation2_m2s_ += elapsed_s * (d0.squaredNorm() + d0.dot(d1) + d1.squaredNorm()) / 3.0;
  }
}

void RunStatistics::add_to_ideal(const ForceComparison& comparison, double elapsed_s) {
  to_ideal_.add(comparison);
  if (elapsed_s > 0.0) largest_error_.add(elapsed_s, comparison.integrals().error_ns);
}

void RunStatistics::add_fallback(const DeviceTick& tick) {
  if (tick.guard == GuardState::kAnswered) was_answered_ = true;
  if (tick.guard == GuardState::kAnswered || tick.guard == GuardState::kLeased) {
    fallback_from_.reset();
    return;
  }
  if (!was_answered_) return;
  if (!fallback_from_) fallback_from_ = tick.switched_at;
  longest_fallback_s_ =
      std::max(longest_fallback_s_, to_seconds(tick.switched_at - *fallback_from_));
}

std::uint64_t RunStatistics::excess_reversals() const {
  const std::uint64_t own = reversals_.total();
  const std::uint64_t ideal = ideal_reversals_.total();
  return own > ideal ? own - ideal : 0;
}

double RunStatistics::path_deviation_rms_m() const {
  return deviation_s_ > 0.0 ? std::sqrt(deviation2_m2s_ / deviation_s_) : kNaN;
}

double RunStatistics::path_deviation_peak_m() const { return deviation_peak_m_; }

double RunStatistics::clamp_ratio() const {
  return requested_ticks_ > 0
             ? static_cast<double>(clamped_ticks_) / static_cast<double>(requested_ticks_)
             : kNaN;
}

double answered_ratio(const DeviceCounters& counters) {
  const std::uint64_t scheduled = counters.loop.ticks + counters.loop.skipped_ticks;
  return scheduled > 0
             ? static_cast<double>(counters.answered_ticks) / static_cast<double>(scheduled)
             : kNaN;
}

nlohmann::ordered_json number_or_null(double value) {
  if (!std::isfinite(value)) return nullptr;
  return value;
}

nlohmann::ordered_json summary_json(const Session& session, const RunReport& report) {
  const RunStatistics& s = report.statistics;
  const bool has_ideal = std::isfinite(s.path_deviation_peak_m());
  const auto reversals = s.reversals();
  const auto ideal = s.ideal_reversals();
  const Vector3 transparency = s.transparency();
  nlohmann::ordered_json json;
  json["schema_version"] = kSummarySchemaVersion;
  json["session"] = session.name;
  json["controller"] = controller_text(session.side().mofc);
  json["seed"] = session.seed;
  json["simulated_s"] = number_or_null(report.simulated_s);
  json["ticks"] = s.ticks();
  json["in_contact_ticks"] = s.contact_ticks();
  json["transparency"] = {{"x", number_or_null(transparency.x())},
                          {"y", number_or_null(transparency.y())},
                          {"z", number_or_null(transparency.z())},
                          {"vector", number_or_null(s.vector_transparency())},
                          {"ideal", number_or_null(s.ideal_transparency())}};
  if (session.side().device.wrist) {
    json["torque_transparency"] = number_or_null(s.torque_transparency());
    json["torque_error_rms_ratio"] = number_or_null(s.torque_error_rms_ratio());
    json["max_torque_newton_m"] = number_or_null(s.maximum_torque_newton_m());
  }
  json["gain"] = number_or_null(s.gain());
  json["force_error_rms_ratio"] = number_or_null(s.force_error_rms_ratio());
  json["largest_force_error_20ms_n"] = number_or_null(s.largest_force_error_newton());
  json["ideal_run_force_error_rms_ratio"] = number_or_null(s.ideal_run_force_error_rms_ratio());
  json["beyond_jnd_ratio"] = number_or_null(s.beyond_jnd_ratio());
  json["min_true_energy_j"] = number_or_null(s.minimum_true_energy_joule());
  json["max_force_n"] = number_or_null(s.maximum_force_newton());
  json["largest_jump_n"] = number_or_null(report.device.largest_jump_newton);
  json["monitor"] = report.device.is_monitor_off ? "off" : "on";
  json["monitor_reductions"] = report.device.monitor_reductions;
  json["ledger_excesses"] = report.device.ledger_excesses;
  json["has_motor_watchdog"] = !report.device.has_no_motor_watchdog;
  json["accepts_no_motor_watchdog"] = report.device.accepts_no_motor_watchdog;
  json["velocity_reversals"] = {{"x", reversals[0]}, {"y", reversals[1]}, {"z", reversals[2]}};
  if (has_ideal) {
    json["velocity_reversals"]["ideal"] = {{"x", ideal[0]}, {"y", ideal[1]}, {"z", ideal[2]}};
    json["velocity_reversals"]["excess"] = s.excess_reversals();
  } else {
    json["velocity_reversals"]["ideal"] = nullptr;
    json["velocity_reversals"]["excess"] = nullptr;
  }
  json["path_deviation_rms_m"] = number_or_null(s.path_deviation_rms_m());
  json["path_deviation_peak_m"] = number_or_null(s.path_deviation_peak_m());
  json["clamp_ratio"] = number_or_null(s.clamp_ratio());
  json["debt_ticks"] = report.mofc.debt_ticks;
  json["answered_ratio"] = number_or_null(answered_ratio(report.device));
  json["motions_suppressed"] = report.mofc.motions_suppressed;
  json["physics_term"] = report.mofc.physics_term;
  json["standby_ticks"] = report.mofc.standby_ticks;
  json["physics_switches"] = report.mofc.physics_switches;
  json["grips"] = report.mofc.grips;
  json["grips_torn"] = report.mofc.grips_torn;
  json["grips_slipped"] = report.mofc.grips_slipped;
  json["punctures"] = report.mofc.punctures;
  json["interactions_suppressed"] = report.physics.interactions_suppressed;
  json["elastic"] = elastic_json(report.physics);
  json["device_faults"] = report.device.device_faults;
  json["last_fault"] = name(report.device.last_fault);
  json["fault_ticks"] = report.device.fault_ticks;
  json["fallbacks"] = report.device.fallback_ticks + report.device.limp_ticks;
  json["wall_s"] = number_or_null(report.wall_s);
  json["ticks_per_wall_s"] =
      number_or_null(static_cast<double>(s.ticks()) / std::max(report.wall_s, 1e-9));
  json["verdict"] = verdict_json(judge(facts_of(session, report)));
  return json;
}

std::string monitor_text(const DeviceCounters& device) {
  if (device.is_monitor_off) return "off";
  std::string text = fmt::format("on, {} commands reduced", device.monitor_reductions);
  if (device.ledger_excesses > 0) {
    text += fmt::format(", the clamp's ledger too high in {} answers", device.ledger_excesses);
  }
  if (device.checked_friction_ratio > 0.0 && device.checked_friction_ratio < 1.0) {
    text += fmt::format(", friction lowered to {:.0f} % of the profile",
                        100.0 * device.checked_friction_ratio);
  }
  return text;
}

nlohmann::ordered_json elastic_json(const PhysicsCounters& physics) {
  if (physics.elastic_solves == 0) return nullptr;
  return {{"solves", physics.elastic_solves},
          {"late", physics.elastic_solves_late},
          {"failed", physics.elastic_solves_failed},
          {"repaired", physics.elastic_solves_repaired},
          {"tips_appeared", physics.elastic_tips_appeared},
          {"error_n", number_or_null(physics.elastic_error_newton)},
          {"bound_n", number_or_null(physics.elastic_bound_newton)},
          {"bounds_checked", physics.elastic_bounds_checked},
          {"bound_violations", physics.elastic_bound_violations},
          {"contact_steps", physics.elastic_contact_steps},
          {"unknown_bound_steps", physics.elastic_unknown_bound_steps},
          {"energised_steps", physics.elastic_energised_steps},
          {"bodies_remade", physics.elastic_bodies_remade},
          {"bodies_refused", physics.elastic_bodies_refused},
          {"elements_removed", physics.elastic_elements_removed},
          {"elements_loose", physics.elastic_elements_loose},
          {"bodies_restored", physics.elastic_bodies_restored},
          {"attachments_torn", physics.elastic_attachments_torn},
          {"torn_joule", physics.elastic_torn_joule},
          {"faces_cut", physics.elastic_faces_cut},
          {"cut_joule", physics.elastic_cut_joule}};
}

std::string elastic_text(const PhysicsCounters& physics) {
  if (physics.elastic_solves == 0) return {};
  std::string text = fmt::format("{} full solutions, {} late, {} failed", physics.elastic_solves,
                                 physics.elastic_solves_late, physics.elastic_solves_failed);
  if (physics.elastic_solves_failed > 0) {
    text += fmt::format(" ({} repaired)", physics.elastic_solves_repaired);
  }
  if (physics.elastic_tips_appeared > 0) {
    text += fmt::format("; {} times a tool appeared inside", physics.elastic_tips_appeared);
  }
  if (physics.elastic_energised_steps > 0) {
    text += fmt::format("; ablated {} elements, {} of them loose, in {} bodies",
                        physics.elastic_elements_removed, physics.elastic_elements_loose,
                        physics.elastic_bodies_remade);
    if (physics.elastic_bodies_refused > 0) {
      text += fmt::format(" ({} more could not be made)", physics.elastic_bodies_refused);
    }
  }
  if (physics.elastic_torn_joule > 0.0) {
    text += fmt::format("; tore {} points off with {:.2g} mJ", physics.elastic_attachments_torn,
                        1e3 * physics.elastic_torn_joule);
  }
  if (physics.elastic_cut_joule > 0.0) {
    text += fmt::format("; cut {} faces with {:.2g} mJ", physics.elastic_faces_cut,
                        1e3 * physics.elastic_cut_joule);
  }
  if (physics.elastic_bodies_restored > 0) {
    text += fmt::format("; restored {} times", physics.elastic_bodies_restored);
  }
  const auto newton = [](double value) {
    return std::isnan(value) ? std::string("unknown") : fmt::format("{:.2g} N", value);
  };
  return text + fmt::format(
                    "; error between them {}, bound {}, exceeded {} of {} times, unknown in "
                    "{} of {} steps",
                    newton(physics.elastic_error_newton), newton(physics.elastic_bound_newton),
                    physics.elastic_bound_violations, physics.elastic_bounds_checked,
                    physics.elastic_unknown_bound_steps, physics.elastic_contact_steps);
}

std::string speaker_text(const MofcCounters& mofc) {
  return fmt::format("{} speaks (term {}); {} of {} ticks from the standby, {} switches",
                     mofc.physics_term % 2 == 1 ? "the standby" : "the first", mofc.physics_term,
                     mofc.standby_ticks, mofc.ticks, mofc.physics_switches);
}

std::string figure(double value, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string("–");
}

std::string energy_text(double joule) {
  const double size = std::abs(joule);
  constexpr double kRoundsUp = 0.9995;  // to four digits before the point
  if (size >= 1e3 * kRoundsUp) return fmt::format("{:.0f} J", joule);
  if (size >= kRoundsUp) return fmt::format("{:.3g} J", joule);
  if (size >= 1e-3 * kRoundsUp) return fmt::format("{:.3g} mJ", 1e3 * joule);
  return fmt::format("{:.3g} µJ", 1e6 * joule);
}

std::string summary_text(const Session& session, const RunReport& report) {
  const RunStatistics& s = report.statistics;
  const Vector3 transparency = s.transparency();
  const auto reversals = s.reversals();
  const auto total = reversals[0] + reversals[1] + reversals[2];
  const bool has_ideal = std::isfinite(s.path_deviation_peak_m());
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<24}{}\n", label, value);
  };
  text += fmt::format("{}: {}, {:g} s simulated, {} ticks\n", session.name,
                      controller_text(session.side().mofc), report.simulated_s, s.ticks());
  line("in contact", fmt::format("{} ticks", s.contact_ticks()));
  line(
      "transparency x, y, z",
      fmt::format("{}, {}, {} (rendered / requested, per axis)", figure(transparency.x(), "{:.3f}"),
                  figure(transparency.y(), "{:.3f}"), figure(transparency.z(), "{:.3f}")));
  line("transparency, vector",
       figure(s.vector_transparency(), "{:.3f}") + " (rendered / requested), " +
           figure(s.ideal_transparency(), "{:.3f}") + " (rendered / ideal)");
  line("gain", figure(s.gain(), "{:.3f}") + " (rendered / ideal, projected, not capped)");
  line("force error, rms", figure(s.force_error_rms_ratio(), "{:.3f}") + " of the ideal force; " +
                               figure(100.0 * s.beyond_jnd_ratio(), "{:.1f} %") +
                               " of the time beyond the force JND");
  if (session.side().device.wrist) {
    line("torque", figure(s.torque_transparency(), "{:.3f}") + " (rendered / ideal), error rms " +
                       figure(s.torque_error_rms_ratio(), "{:.3f}") + " of the ideal, largest " +
                       figure(s.maximum_torque_newton_m(), "{:.4f} N·m"));
  }
  line("force error, 20 ms",
       figure(s.largest_force_error_newton(), "{:.3f} N") + ", the largest mean over 20 ms");
  line("clamped", figure(100.0 * s.clamp_ratio(), "{:.1f} %") + " of the ticks with a force");
  line("largest force",
       figure(s.maximum_force_newton(), "{:.3f} N") +
           figure(report.device.largest_jump_newton, ", largest jump from tick to tick {:.3f} N"));
  line("monitor", monitor_text(report.device));
  if (report.device.has_no_motor_watchdog)
    line("motor watchdog", no_watchdog_text(report.device.accepts_no_motor_watchdog));
  const double least_joule = s.minimum_true_energy_joule();
  line("least true energy", std::isfinite(least_joule) ? energy_text(least_joule) : "–");
  line("velocity reversals",
       has_ideal ? fmt::format("{}, {} more than the ideal run", total, s.excess_reversals())
                 : fmt::format("{}", total));
  line("path deviation", figure(1e3 * s.path_deviation_rms_m(), "{:.3f} mm") + " rms, " +
                             figure(1e3 * s.path_deviation_peak_m(), "{:.3f} mm") + " peak");
  line("answered in time",
       figure(100.0 * answered_ratio(report.device), "{:.3f} %") +
           fmt::format(" of {} scheduled ticks",
                       report.device.loop.ticks + report.device.loop.skipped_ticks));
  if (session.physics.standby) line("physics", speaker_text(report.mofc));
  if (const std::string elastic = elastic_text(report.physics); !elastic.empty()) {
    line("elastic tissue", elastic);
  }
  const double times = report.simulated_s / std::max(report.wall_s, 1e-9);
  line("speed", fmt::format("{:.0f} ticks/s, {} times real time",
                            static_cast<double>(s.ticks()) / std::max(report.wall_s, 1e-9),
                            figure(times, times < 10.0 ? "{:.2g}" : "{:.0f}")));
  return text;
}

}  // namespace palpate
