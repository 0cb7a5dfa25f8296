// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/verdict.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <utility>

#include "common/telemetry/verdict/causes.h"
#include "common/telemetry/verdict/device_findings.h"
#include "common/telemetry/verdict/remedies.h"

namespace palpate {
namespace {

constexpr double kBadSilence_ratio = 0.10;  // of the ticks without physics
constexpr double kBadTooFast_ratio = 0.01;  // of the ticks with a hand beyond v_max
constexpr double kLostTelemetry_ratio = 0.01;
constexpr double kLongStart_s = 1.0;  // until the first answer

Grade grade_above(double value, double fair, double bad) {
  return value >= bad ? Grade::kBad : value >= fair ? Grade::kFair : Grade::kGood;
}

/// Builds the findings in order; a later one may refer to an earlier one as its cause.
class Judge {
 public:
  explicit Judge(const RunFacts& facts) : f_(facts) {}
  std::vector<RunFinding> findings() {
    tell_what_is_left_out();
    if (!f_.device_node.is_heard && f_.device_node.is_recorded) {
      add({Grade::kBad, "device_silent", "no telemetry of device_node was received",
           keys_remedy("see its messages; `palpate doctor SESSION` checks the machine")});
      return std::move(findings_);
    }
    for (RunFinding& one : device_findings(f_)) findings_.push_back(std::move(one));
    judge_nodes();
    judge_physics();
    judge_hand();
    judge_monitor();
    judge_ledger();
    judge_ticks();
    judge_energy();
    judge_limits();
    judge_contact();
    judge_force();
    judge_telemetry();
    raise_causes();
    return std::move(findings_);
  }

 private:
  void add(OwnFinding&& one) { findings_.push_back(std::move(one).finding()); }
  void good(const char* what, std::string text) {
    findings_.push_back({Grade::kGood, what, "", std::move(text), ""});
  }
  /// A consequence: of what was found before, or of something else that it names itself.
  void add(Grade grade, const char* what, const std::string& text, Cause&& cause,
           double share = 1.0) {
    findings_.push_back({grade, what, std::move(cause.what), text, std::move(cause.remedy), share});
  }

  [[nodiscard]] std::uint64_t ticks() const {
    return f_.device.loop.ticks + f_.device.loop.skipped_ticks;
  }
  [[nodiscard]] std::string keys_remedy(const char* otherwise) const {
    const std::uint64_t refused =
        f_.device_node.peers_refused + f_.mofc_node.peers_refused + f_.physics_node.peers_refused;
    if (refused == 0) return otherwise;
    return fmt::format(
        "{} connections were refused: the key folders of the machines must belong "
        "together (`palpate keygen`)",
        refused);
  }

  /// What cannot be known is not judged.
  void tell_what_is_left_out() {
    const std::string nodes = nodes_left_out(f_);
    if (nodes.empty()) return;
    good("left_out", "the recording leaves out " + nodes + ": not judged");
  }

  [[nodiscard]] bool has_physics_spoken() const {
    return f_.mofc.interaction.accepted + f_.mofc.standby_interaction.accepted > 0;
  }

  /// Of what is as it is because the session wants it so.
  [[nodiscard]] std::string simulated_remedy(std::initializer_list<SimulatedAt> places,
                                             std::string otherwise) const {
    for (const SimulatedAt place : places) {
      if (auto cause = causes_.simulated(place, 1.0)) return std::move(cause->remedy);
    }
    return otherwise;
  }
  [[nodiscard]] std::string remedy_of_lie(std::string otherwise) const {
    return simulated_remedy({SimulatedAt::kClamp}, std::move(otherwise));
  }

  [[nodiscard]] bool has_fault() const { return palpate::has_fault(f_); }

  /// What caused a finding is as grave as it.
  void raise_causes() {
    for (auto effect = findings_.rbegin(); effect != findings_.rend(); ++effect) {
      for (RunFinding& one : findings_) {
        const bool is_cause = one.grade != Grade::kGood && one.what == effect->cause;
        if (is_cause) one.grade = std::max(one.grade, effect->grade);
      }
    }
  }

  /// What the device's own limits take from the force.
  void judge_limits() {
    const DeviceCounters& device = f_.device;
    if (f_.mofc.contact_ticks == 0) return;
    if (is_held_by_no_watchdog(f_)) findings_.push_back(no_motor_watchdog(f_));
    const double cut = std::min(1.0, ratio(device.peak_limited_ticks, f_.mofc.contact_ticks));
    const Grade grade = grade_above(cut, kFairRatio, kBadRatio);
    if (grade == Grade::kGood) return;
    const std::string text = "the device's peak force or slew limit cut the force in " +
                             percent(cut) + " of the contact";
    if (auto lie = causes_.simulated(SimulatedAt::kClamp, cut)) {
      add(grade, "peak_force", text, std::move(*lie), cut);
    } else if (auto limit = causes_.held_to_no_force()) {
      add(grade, "peak_force", text, std::move(*limit), cut);
    } else if (causes_.is_other_controller()) {  // what oscillates saturates
      add(grade, "peak_force", text, causes_.of_loss(cut), cut);
    } else {
      add({grade, "peak_force", text,
           "softer tissue, less depth, a stronger device, or what it can do in "
           "device.peak_force_newton and device.slew_newton_per_s",
           cut});
    }
  }

  void judge_nodes() {
    const auto restarted = [&](const char* what, const char* node, std::uint64_t restarts,
                               const std::optional<Cause>& simulated = std::nullopt) {
      if (restarts == 0) return;
      add(Grade::kBad, what,
          fmt::format("{} was restarted {}", node,
                      restarts == 1 ? "once" : fmt::format("{} times", restarts)),
          simulated.value_or(Cause{what, "its log says why it ended"}));
    };
    restarted("device_restarted", "device_node", f_.device_node.restarts);
    restarted("mofc_restarted", "mofc_node", f_.mofc_node.restarts);
    // one that never spoke is silent
    if (has_physics_spoken()) {
      restarted("physics_restarted", "physics_node", f_.physics_node.restarts,
                f_.adversary.physics == HostilePhysics::kNewSessions
                    ? causes_.simulated(SimulatedAt::kPhysics, 1.0)
                    : std::nullopt);
    }
    if (f_.device.loop.ticks > 0 && f_.device.answered_ticks == 0 && !has_fault() &&
        !causes_.found(
            {"device_not_enabled", "device_waited", "dead_man_button", "position_frozen"})) {
      add({Grade::kBad, "mofc_silent", "mofc_node never answered device_node in time",
           simulated_remedy(
               {SimulatedAt::kExchange, SimulatedAt::kClamp, SimulatedAt::kDevice},
               keys_remedy(f_.mofc_node.is_heard ? "both run; run `palpate doctor`, check "
                                                   "links.exchange, device.rate_hz, reply_us"
                                                 : "it was not heard: see its messages"))});
    }
    if (f_.device.non_finite_commands > 0) {
      add({Grade::kBad, "command_not_finite",
           fmt::format("mofc_node sent {} commands that are not numbers",
                       f_.device.non_finite_commands),
           remedy_of_lie("a controller of your own? check it with `palpate loopback`")});
    }
  }

  void judge_physics() {
    const MofcCounters& mofc = f_.mofc;
    if (mofc.ticks > 0 && !has_physics_spoken() && !(has_fault() && f_.physics_node.is_heard)) {
      const auto simulated = causes_.simulated(SimulatedAt::kPhysics, 1.0);
      add({Grade::kBad, "physics_silent", "mofc_node never heard the physics: no force of tissue",
           simulated ? simulated->remedy
           : f_.physics_node.is_heard
               ? keys_remedy("it runs, but its answers do not arrive: check links.interaction")
           : f_.physics_node.restarts > 0
               ? fmt::format(
                     "it was not heard, and was started {} times: its log says why it ended",
                     f_.physics_node.restarts + 1)
               : keys_remedy("it was not heard: see its messages; a large scene may still load")});
    } else if (const double silent = ratio(mofc.stale_ticks, mofc.ticks); silent > kFewTicks) {
      add(silent >= kBadSilence_ratio ? Grade::kBad : Grade::kFair, "physics_silent",
          "physics was silent, and the force faded, in " + percent(silent) + " of the ticks",
          causes_.of_silent_physics(silent), silent);
    }
    // what waits for the physics asks for its steps
    const double late = ratio(mofc.late_physics_ticks, mofc.ticks);
    const double missing = f_.waits_for_physics ? late : 1.0 - f_.physics_hz / f_.physics_rate_hz;
    // after a fault the device asks for no more steps
    const bool is_asked =
        !f_.waits_for_physics || ratio(f_.device.fault_ticks, ticks()) < kFairRatio;
    if (is_asked && missing > 1.0 - kFairPhysicsRate_ratio) {
      add(missing > 1.0 - kBadPhysicsRate_ratio ? Grade::kBad : Grade::kFair, "physics_slow",
          f_.waits_for_physics
              ? "physics answered too late in " + percent(late) + " of the ticks"
              : fmt::format("physics made {} of {} steps a second", thousands(f_.physics_hz),
                            thousands(f_.physics_rate_hz)),
          causes_.of_slow_physics(missing), missing);
    }
    const PhysicsCounters& physics = f_.physics;
    if (ratio(physics.elastic_solves_late, physics.elastic_solves) >= kFairRatio) {
      add({Grade::kFair, "elastic_late",
           fmt::format("{} of {} solutions of elastic tissue took longer than their period",
                       physics.elastic_solves_late, physics.elastic_solves),
           "use a coarser mesh, or a lower elastic.solve_rate_hz"});
    }
    if (physics.elastic_solves_failed > 0) {
      add({ratio(physics.elastic_solves_failed, physics.elastic_solves) >= kFairRatio
               ? Grade::kBad
               : Grade::kFair,
           "elastic_failed",
           fmt::format("{} of {} solutions of elastic tissue failed and were undone, {} repaired",
                       physics.elastic_solves_failed, physics.elastic_solves,
                       physics.elastic_solves_repaired),
           "press less deep, give a finer mesh, or a larger tip"});
    }
  }

  void judge_hand() {
    const std::uint64_t too_fast = std::max(f_.mofc.too_fast_ticks, f_.device.too_fast_readings);
    if (too_fast == 0) return;
    const double share = ratio(too_fast, ticks());
    if (is_path_too_fast(f_)) {
      add({share >= kBadTooFast_ratio ? Grade::kBad : Grade::kFair, "path_jumps",
           fmt::format("the recorded hand was faster than v_max, {:g} m/s, in {} ticks",
                       f_.v_max_m_per_s, too_fast),
           path_remedy(f_), share});
      return;
    }
    if (auto coarse = causes_.found({"encoder_coarse"})) {
      add(share >= kBadTooFast_ratio ? Grade::kBad : Grade::kFair, "hand_too_fast",
          fmt::format("by its positions the hand was faster than v_max, {:g} m/s, in {} ticks",
                      f_.v_max_m_per_s, too_fast),
          std::move(*coarse), share);
      return;
    }
    add({share >= kBadTooFast_ratio ? Grade::kBad : Grade::kFair, "hand_too_fast",
         fmt::format("the hand was faster than v_max, {:g} m/s, in {} ticks: there the guarantee "
                     "does not hold",
                     f_.v_max_m_per_s, too_fast),
         "move more slowly, or raise mofc.guard_settings.v_max_m_per_s", share});
  }

  void judge_ledger() {
    const std::uint64_t excesses = f_.device.ledger_excesses;
    if (excesses == 0) return;
    add({ratio(excesses, ticks()) >= kFairRatio ? Grade::kBad : Grade::kFair, "ledger_too_high",
         fmt::format(
             "the clamp counted on more energy than the hand can have put in, in {} answers",
             excesses),
         remedy_of_lie(disagreement_remedy(f_)), ratio(excesses, ticks())});
  }

  void judge_monitor() {
    const DeviceCounters& device = f_.device;
    if (device.monitor_reductions == 0) return;
    const double share = ratio(device.monitor_reductions, ticks());
    add({share >= kFairRatio ? Grade::kBad : Grade::kFair, "monitor_reduced",
         fmt::format("the monitor on the device reduced {} commands", device.monitor_reductions),
         remedy_of_lie(disagreement_remedy(f_)), share});
  }

  void judge_ticks() {
    if (ticks() == 0) return;
    const std::uint64_t start = start_up_ticks(f_.device);
    const std::uint64_t judged = ticks() - std::min(start, ticks() - 1);
    const double answered = ratio(f_.device.answered_ticks, judged);
    const double skipped = ratio(f_.device.loop.skipped_ticks, judged);
    const double unanswered = 1.0 - answered - skipped;
    const double start_s = static_cast<double>(start) / f_.device_rate_hz;
    if (start_s > kLongStart_s) {
      add({Grade::kGood, "start_up",
           fmt::format("the first {:.2g} s passed before the first answer, and are not judged",
                       start_s),
           f_.is_simulated ? "the log of mofc_node says what it waited for"
                           : "mofc_node began later, or the device waited for a person"});
    }
    if (skipped > kFewTicks) {
      add(skipped >= kFairRatio ? Grade::kBad : Grade::kFair, "ticks_skipped",
          percent(skipped) + " of the ticks were skipped", causes_.of_late_ticks(skipped), skipped);
    }
    if (unanswered > kFewTicks) {
      add(unanswered >= kFairRatio ? Grade::kBad : Grade::kFair, "ticks_unanswered",
          percent(unanswered) + " of the ticks were not answered in time",
          causes_.of_no_answer(unanswered), unanswered);
    }
    if (skipped <= kFewTicks && unanswered <= kFewTicks) {
      good("ticks_answered",
           fmt::format("{:.2f} % of the ticks answered in time", 100.0 * answered));
    }
  }

  void judge_energy() {
    const double energy_joule = f_.minimum_true_energy_joule;
    if (std::isnan(energy_joule)) return;  // a real device does not tell
    if (energy_joule >= kLeastEnergy_joule) {
      good("energy", "the hand extracted no energy");
      return;
    }
    add(Grade::kBad, "energy_extracted", "the hand extracted " + energy_text(-energy_joule),
        causes_.of_extracted_energy());
  }

  void judge_contact() {
    const MofcCounters& mofc = f_.mofc;
    if (!f_.mofc_node.is_recorded) return;
    if (ticks() > 0 && mofc.contact_ticks == 0) {
      const std::uint64_t touched = f_.true_contact_ticks;
      add(Grade::kBad, "no_contact",
          touched == 0
              ? "the tool never touched tissue"
              : fmt::format("the tool was in tissue in {} ticks, of which mofc_node never heard",
                            touched),
          causes_.of_no_contact());
      return;
    }
    judge_whether_felt();
    if (!f_.is_limited) return;  // other controllers change every force
    const double debt = std::min(1.0, ratio(mofc.debt_ticks, mofc.contact_ticks));
    if (debt >= kFairRatio) {
      add(grade_above(debt, kFairRatio, kBadRatio), "energy_debt",
          "in " + percent(debt) +
              " of the contact the account of the energy was in debt, and the force was held to "
              "what friction bears",
          causes_.of_debt(debt), debt);
    }
    // also after contact, where a controller asks for force there
    const double clamped = std::min(1.0, ratio(mofc.clamped_ticks, mofc.contact_ticks));
    const Grade grade = grade_above(clamped, kFairRatio, kBadRatio);
    if (grade == Grade::kGood) {
      good("clamped", "the clamp left " + percent(1.0 - clamped) + " of the contact as it is");
    } else {
      add(grade, "clamped", percent(clamped) + " of the contact was clamped",
          causes_.of_loss(clamped));
    }
  }

  void judge_whether_felt() {
    if (f_.force_ratio == 0.0) {
      add({Grade::kBad, "force_ratio", "the hand felt nothing: device.workspace.force_ratio is 0",
           "give 1, or the share of the force that the hand is to feel"});
    } else if (f_.maximum_force_newton == 0.0 && f_.device_node.is_recorded && !has_fault() &&
               !causes_.found({"device_not_enabled", "dead_man_button", "mofc_silent"})) {
      add(Grade::kBad, "no_force", "the tool touched tissue, and no force was rendered",
          causes_.of_loss(1.0));
    }
  }

  void judge_force() {
    if (f_.mofc.contact_ticks == 0) return;
    /// @param loss  share of the contact that it stands for
    const auto graded = [&](const char* what, double value, double loss, const std::string& text) {
      if (std::isnan(value)) return;
      const Grade grade = grade_above(value, kFairRatio, kBadRatio);
      if (grade == Grade::kGood) {
        good(what, text);
      } else {
        add(grade, what, text, causes_.of_loss(loss));
      }
    };
    // all of the force missing in a share of the contact is its root as rms
    graded("force_error", f_.force_error_rms_ratio,
           std::min(1.0, f_.force_error_rms_ratio * f_.force_error_rms_ratio),
           "the force is " + percent(f_.force_error_rms_ratio) + " rms off the ideal one");
    graded("beyond_jnd", f_.beyond_jnd_ratio, f_.beyond_jnd_ratio,
           "the difference can be felt in " + percent(f_.beyond_jnd_ratio) + " of the samples");
    if (f_.physics.elastic_bound_newton > 0.0 && f_.maximum_force_newton > 0.0) {
      const double bound = f_.physics.elastic_bound_newton / f_.maximum_force_newton;
      graded(
          "elastic_bound", bound, 0.0,
          fmt::format("the force of elastic tissue is within {:.2g} N of its solution, {} of the "
                      "largest force",
                      f_.physics.elastic_bound_newton, percent(bound)));
    }
    const PhysicsCounters& p = f_.physics;
    judge_bound("elastic_no_bound", p.elastic_unknown_bound_steps, p.elastic_contact_steps,
                " of the contact with elastic tissue has no bound of its error");
    judge_bound("elastic_bound_exceeded", p.elastic_bound_violations, p.elastic_bounds_checked,
                " of the measured errors of elastic tissue were above their bound");
    if (f_.excess_reversals) {
      const std::uint64_t excess = *f_.excess_reversals;
      const std::string text =
          fmt::format("{} reversals more than the ideal run{}",
                      excess == 0 ? "no" : thousands(static_cast<double>(excess)),
                      excess >= kBadReversals ? ": the hand chatters" : "");
      if (excess >= kBadReversals) {
        add(Grade::kBad, "reversals", text, causes_.of_loss(0.0));
      } else {
        good("reversals", text);
      }
    }
  }

  /// Of elastic tissue; fair at most: nothing is known to be bad.
  void judge_bound(const char* what, std::uint64_t part, std::uint64_t whole, const char* text) {
    if (ratio(part, whole) < kFairRatio) return;
    add(Grade::kFair, what, percent(ratio(part, whole)) + text, causes_.of_loss(0.0));
  }

  void judge_telemetry() {
    if (f_.ticks_received == 0 || f_.device.loop.ticks <= f_.ticks_received) return;
    const double lost = 1.0 - ratio(f_.ticks_received, f_.device.loop.ticks);
    if (lost < kLostTelemetry_ratio) return;
    add({Grade::kFair, "telemetry_lost",
         percent(lost) + " of the ticks did not reach this program: figures of the ticks received "
                         "are incomplete",
         "it began late, or the machine or the network is too busy"});
  }

  const RunFacts& f_;
  std::vector<RunFinding> findings_;
  Causes causes_{f_, findings_};
};

}  // namespace

std::vector<RunFinding> judge(const RunFacts& facts) { return Judge(facts).findings(); }

}  // namespace palpate
