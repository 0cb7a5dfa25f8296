// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/verdict.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "common/session/path_speed.h"

namespace palpate {

RunFacts facts_of(const Session& session, const Side& side) {
  RunFacts facts;
  facts.is_session_known = true;
  facts.controller = controller_text(side.mofc);
  facts.is_limited = side.mofc.controller == ControllerKind::kMofc || side.mofc.has_safety_net;
  facts.is_local = side.mofc.interaction == InteractionUse::kLocal;
  facts.waits_for_physics = side.mofc.wait_for_physics > Duration::zero();
  facts.has_kalman_velocity = std::holds_alternative<KalmanVelocity>(side.mofc.velocity_estimator);
  facts.is_simulated = !is_real(side.driver);
  facts.device_rate_hz = side.device.rate_hz;
  facts.coulomb_newton = side.device.profile.coulomb_newton;
  facts.position_resolution_m = side.device.profile.position_resolution_m;
  facts.latency_s = to_seconds(side.device.latency);
  facts.start_ramp_s = to_seconds(side.device.start_ramp);
  facts.physics_rate_hz = session.physics.rate_hz;
  facts.force_ratio = side.device.workspace.force_ratio;
  facts.credit_cap_joule = side.mofc.guard.credit_cap_joule;
  facts.is_foreign_physics = !session.physics_command.empty();
  facts.interaction_deadband = session.physics.interaction_deadband;
  facts.motion_deadband = side.mofc.motion_deadband;
  facts.sides = session.sides.size();
  facts.v_max_m_per_s = side.device.monitor.v_max_m_per_s;
  for (const TissueConfig& tissue : session.scene.tissues) {
    if (const auto* elastic = std::get_if<ElasticMaterial>(&tissue.material)) {
      facts.solve_rate_hz = std::fmin(facts.solve_rate_hz, elastic->solve_rate_hz);
    }
  }
  if (facts.is_simulated && std::holds_alternative<RecordedPath>(side.hand.path)) {
    const PathSpeed fastest = top_speed_of(side.hand.path);
    facts.path_m_per_s = fastest.m_per_s;
    facts.path_at_s = fastest.at_s;
  }
  facts.has_tissue = !session.scene.tissues.empty() || !session.physics_command.empty();
  facts.duration_s = session.duration_s;
  facts.faults = session.faults;
  facts.adversary = session.adversary;
  return facts;
}

RunFacts facts_of(const Session& session, const RunReport& report) {
  RunFacts facts = facts_of(session, session.side());
  const RunStatistics& s = report.statistics;
  facts.is_in_real_time = false;
  facts.device = report.device;
  facts.mofc = report.mofc;
  facts.physics = report.physics;
  const auto restarts = [](const LinkCounters& link) {
    return link.sessions > 0 ? link.sessions - 1 : 0;
  };
  facts.physics_node.restarts = restarts(report.mofc.interaction);
  facts.device_node.restarts = restarts(report.mofc.device_state);
  facts.mofc_node.restarts = restarts(report.device.force_command);
  if (report.simulated_s > 0.0) {
    facts.physics_hz = static_cast<double>(report.physics.loop.ticks) / report.simulated_s;
  }
  facts.clutched_ticks = s.clutched_ticks();
  facts.true_contact_ticks = s.contact_ticks();
  facts.minimum_true_energy_joule = s.minimum_true_energy_joule();
  facts.maximum_force_newton = s.maximum_force_newton();
  facts.force_error_rms_ratio = s.force_error_rms_ratio();
  facts.beyond_jnd_ratio = s.beyond_jnd_ratio();
  if (std::isfinite(s.path_deviation_rms_m())) facts.excess_reversals = s.excess_reversals();
  return facts;
}

const char* name(Grade grade) {
  switch (grade) {
    case Grade::kGood:
      return "good";
    case Grade::kFair:
      return "fair";
    case Grade::kBad:
      return "bad";
  }
  return "?";
}

Grade grade_of(const std::vector<RunFinding>& findings) {
  Grade worst = Grade::kGood;
  for (const RunFinding& finding : findings) worst = std::max(worst, finding.grade);
  return worst;
}

std::string cause_of(const std::vector<RunFinding>& findings) {
  const Grade worst = grade_of(findings);
  if (worst == Grade::kGood) return {};
  return std::find_if(findings.begin(), findings.end(),
                      [&](const RunFinding& one) { return one.grade == worst; })
      ->cause;
}

nlohmann::ordered_json verdict_json(const std::vector<RunFinding>& findings) {
  nlohmann::ordered_json json;
  json["grade"] = name(grade_of(findings));
  json["cause"] = cause_of(findings);
  json["findings"] = nlohmann::ordered_json::array();
  for (const RunFinding& finding : findings) {
    nlohmann::ordered_json one;
    one["grade"] = name(finding.grade);
    one["what"] = finding.what;
    one["cause"] = finding.cause;
    one["text"] = finding.text;
    one["remedy"] = finding.remedy;
    json["findings"].push_back(std::move(one));
  }
  return json;
}

}  // namespace palpate
