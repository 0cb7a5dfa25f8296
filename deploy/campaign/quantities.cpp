// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/quantities.h"

#include <algorithm>

namespace palpate::campaign {
namespace {

double count(std::uint64_t n) { return static_cast<double>(n); }

double top_speed(const RunReport& r, const Side& side) {
  return r.statistics.top_tool_speed_m_per_s() / side.device.workspace.scale_ratio;
}

// clang-format off: one row each
constexpr Quantity kQuantities[] = {
    {"min_true_energy_j", "least true energy of the device's port [J]; below 0 the hand has gained",
     false,
     [](const RunReport& r, const Side&) { return r.statistics.minimum_true_energy_joule(); }},
    {"transparency.vector", "rendered against requested force, projected, 0 … 1", false,
     [](const RunReport& r, const Side&) { return r.statistics.vector_transparency(); }},
    {"transparency.ideal", "rendered against ideal force, projected, 0 … 1", true,
     [](const RunReport& r, const Side&) { return r.statistics.ideal_transparency(); }},
    {"torque_transparency", "rendered against ideal torque of a wrist, projected, 0 … 1", true,
     [](const RunReport& r, const Side&) { return r.statistics.torque_transparency(); }},
    {"torque_error_rms_ratio", "rms of its error over that of the ideal torque", true,
     [](const RunReport& r, const Side&) { return r.statistics.torque_error_rms_ratio(); }},
    {"max_torque_newton_m", "largest torque of one joint of a wrist [N·m]", false,
     [](const RunReport& r, const Side&) { return r.statistics.maximum_torque_newton_m(); }},
    {"gain", "rendered against ideal force, projected, not capped", true,
     [](const RunReport& r, const Side&) { return r.statistics.gain(); }},
    {"force_error_rms_ratio", "rms of the force error over that of the ideal force", true,
     [](const RunReport& r, const Side&) { return r.statistics.force_error_rms_ratio(); }},
    {"beyond_jnd_ratio",
     "share of the time in which the force differs from the ideal by more than the JND", true,
     [](const RunReport& r, const Side&) { return r.statistics.beyond_jnd_ratio(); }},
    {"path_deviation_rms_m", "distance to the tool of the ideal run, rms [m]", true,
     [](const RunReport& r, const Side&) { return r.statistics.path_deviation_rms_m(); }},
    {"path_deviation_peak_m", "the same, largest [m]", true,
     [](const RunReport& r, const Side&) { return r.statistics.path_deviation_peak_m(); }},
    {"excess_reversals", "reversals of the velocity beyond those of the ideal run", true,
     [](const RunReport& r, const Side&) { return count(r.statistics.excess_reversals()); }},
    {"clamp_ratio", "share of the ticks with a force in which it was clamped", false,
     [](const RunReport& r, const Side&) { return r.statistics.clamp_ratio(); }},
    {"max_force_n", "largest force on the hand [N]", false,
     [](const RunReport& r, const Side&) { return r.statistics.maximum_force_newton(); }},
    {"largest_jump_n", "largest change of the force from tick to tick [N]", false,
     [](const RunReport& r, const Side&) { return r.device.largest_jump_newton; }},
    {"longest_fallback_s", "longest time without the force of an answer, after the first [s]",
     false, [](const RunReport& r, const Side&) { return r.statistics.longest_fallback_s(); }},
    {"answered_ratio", "share of the scheduled ticks that were answered in time", false,
     [](const RunReport& r, const Side&) { return answered_ratio(r.device); }},
    {"monitor_reductions", "commands that the monitor reduced", false,
     [](const RunReport& r, const Side&) { return count(r.device.monitor_reductions); }},
    {"ledger_excesses", "answers of a clamp that counts on more energy than can be", false,
     [](const RunReport& r, const Side&) { return count(r.device.ledger_excesses); }},
    {"top_speed_m_per_s", "greatest true speed of the hand at the ticks [m/s]", false, top_speed},
    {"speed_ratio",
     "the same over v_max of mode guard, or that of a wrist; above 1 the guarantee does not apply",
     false,
     [](const RunReport& r, const Side& side) {
       const double of_wrist = side.device.wrist ? r.statistics.top_wrist_speed_rad_per_s() /
                                                       side.device.wrist->v_max_rad_per_s
                                                 : 0.0;
       return std::max(of_wrist, top_speed(r, side) / side.mofc.guard.v_max_m_per_s);
     }},
    {"ticks", "device ticks", false,
     [](const RunReport& r, const Side&) { return count(r.statistics.ticks()); }},
    {"in_contact_ticks", "of these, in contact", false,
     [](const RunReport& r, const Side&) { return count(r.statistics.contact_ticks()); }},
    {"grips", "closings of the jaws that took hold of tissue", false,
     [](const RunReport& r, const Side&) { return count(r.mofc.grips); }},
    {"grips_torn", "of these, torn", false,
     [](const RunReport& r, const Side&) { return count(r.mofc.grips_torn); }},
    {"punctures", "insertions of a needle or a blade", false,
     [](const RunReport& r, const Side&) { return count(r.mofc.punctures); }},
    {"faces_cut", "faces between elements that a blade has passed", false,
     [](const RunReport& r, const Side&) { return count(r.physics.elastic_faces_cut); }},
    {"attachments_torn", "points of elastic bodies torn off", false,
     [](const RunReport& r, const Side&) { return count(r.physics.elastic_attachments_torn); }},
    {"elements_removed", "elements that have vanished", false,
     [](const RunReport& r, const Side&) { return count(r.physics.elastic_elements_removed); }},
    {"motions_suppressed", "messages of hop 2 that the deadband suppressed", false,
     [](const RunReport& r, const Side&) { return count(r.mofc.motions_suppressed); }},
    {"interactions_suppressed", "messages of hop 3 that the deadband suppressed", false,
     [](const RunReport& r, const Side&) { return count(r.physics.interactions_suppressed); }},
};
// clang-format on

}  // namespace

std::span<const Quantity> quantities() { return kQuantities; }

const Quantity* find_quantity(const std::string& name) {
  const auto* const found =
      std::find_if(std::begin(kQuantities), std::end(kQuantities),
                   [&](const Quantity& quantity) { return name == quantity.name; });
  return found == std::end(kQuantities) ? nullptr : found;
}

}  // namespace palpate::campaign
