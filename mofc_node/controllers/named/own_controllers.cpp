// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/named/own_controllers.h"

#include <algorithm>
#include <array>
#include <utility>

#include "guard_mofc.h"
#include "paper_mofc.h"
#include "safety_net.h"
#include "vector_mofc.h"

namespace palpate::controllers {

namespace {

using Settings = ControllerSettings;
using Made = std::unique_ptr<ForceController>;

MofcParameters leased(const Settings& s) {
  return {.f_d = s.viscous_newton_s_per_m, .f_co = s.coulomb_newton, .T = s.lease_s};
}

Made paper(const Settings& s) {
  const MofcParameters p{
      .f_d = s.viscous_newton_s_per_m, .f_co = s.coulomb_newton, .T = period_s(s)};
  if (s.per_axis) return std::make_unique<PaperMofc>(*s.per_axis, p.T);
  return std::make_unique<PaperMofc>(p);
}

Made paper_isotropic(const Settings& s) {
  if (s.per_axis) return paper(s);
  return std::make_unique<PaperMofc>(PaperMofc::isotropic(
      {.f_d = s.viscous_newton_s_per_m, .f_co = s.coulomb_newton, .T = period_s(s)}));
}

Made vector(const Settings& s) {
  return std::make_unique<VectorMofc>(leased(s), s.position_resolution_m, s.delta_max_s, s.per_axis,
                                      s.longest_lease_s, s.prompt_s);
}

GuardParameters guard_parameters(const Settings& s) {
  const MofcParameters p = leased(s);
  // what one hold of the largest force can leak: at low rates more than the gate's own, and four
  // times the cap's
  const double hold_joule = p.T * drain_watt(p, s.peak_force_newton, s.v_max_m_per_s);
  return {.mofc = p,
          .per_axis = s.per_axis,
          .resolution_m = s.position_resolution_m,
          .delta_max_s = s.delta_max_s,
          .prompt_s = s.prompt_s,
          .longest_lease_s = s.longest_lease_s,
          .v_max_m_per_s = s.v_max_m_per_s,
          .credit_cap_joule = std::max(s.credit_cap_joule, 0.25 * hold_joule),
          .contact_credit_joule = hold_joule > s.credit_cap_joule ? hold_joule : 0.0,
          .gate_joule = std::max(s.gate_joule, hold_joule),
          .gate_recovery_s = s.gate_recovery_s};
}

constexpr std::array<ControllerEntry, kOwnControllers> kOwn{{
    {"none", [](const Settings&) -> Made { return std::make_unique<PassThrough>(); }},
    {"guard",
     [](const Settings& s) -> Made { return std::make_unique<GuardMofc>(guard_parameters(s)); }},
    {"vector", vector},
    {"paper", paper},
    {"paper_isotropic", paper_isotropic},
}};

}  // namespace

std::span<const ControllerEntry, kOwnControllers> own_controllers() noexcept { return kOwn; }

Made make_own(std::string_view name, const Settings& settings) {
  const auto entry = std::find_if(kOwn.begin(), kOwn.end(),
                                  [&](const ControllerEntry& e) { return e.name == name; });
  return entry == kOwn.end() ? nullptr : with_safety_net(entry->make(settings), settings);
}

Made with_safety_net(Made made, const Settings& settings) {
  if (made == nullptr || settings.safety_net == 0.0) return made;
  return std::make_unique<SafetyNet>(std::move(made), guard_parameters(settings));
}

}  // namespace palpate::controllers
