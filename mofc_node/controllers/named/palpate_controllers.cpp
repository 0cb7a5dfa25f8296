// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/named/palpate_controllers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <new>
#include <span>
#include <string_view>
#include <utility>

#include "mofc_node/controllers/named/catalogue.h"

using palpate::controllers::AppliedStretch;
using palpate::controllers::ControllerSettings;
using palpate::controllers::ControlOutput;
using palpate::controllers::ForceController;
using palpate::controllers::SettingEntry;
using palpate::controllers::TissueProbe;
using palpate::controllers::Vector3;

namespace {

/// More in one step are not known: they count as a gap.
constexpr std::size_t kMostStretches = 64;

Vector3 vector_of(const double (&values)[3]) { return {values[0], values[1], values[2]}; }

void put(const Vector3& vector, double (&values)[3]) {
  std::copy_n(vector.data(), 3, std::begin(values));
}

class CallbackProbe final : public TissueProbe {
 public:
  explicit CallbackProbe(const palpate_input& input)
      : tissue_(input.tissue), user_(input.tissue_user) {}
  [[nodiscard]] Force at(const Vector3& x, const Vector3& v) const noexcept override {
    Force force;
    tissue_(user_, x.data(), v.data(), force.force_on_hand_newton.data(),
            &force.stored_energy_joule);
    const bool is_known =
        force.force_on_hand_newton.allFinite() && std::isfinite(force.stored_energy_joule);
    return is_known ? force : Force{};
  }

 private:
  palpate_tissue tissue_;
  void* user_;
};

bool is_finite(const palpate_input& input) {
  bool is_good = std::isfinite(input.acting_lease_s) && std::isfinite(input.stored_energy_joule);
  for (const auto* values :
       {&input.hand_position_m, &input.hand_velocity_m_per_s, &input.acting_force_on_hand_newton,
        &input.requested_force_on_hand_newton, &input.evaluated_at_m, &input.surface_normal}) {
    is_good = is_good && vector_of(*values).allFinite();
  }
  for (const palpate_stretch& s : std::span(input.applied, input.applied_count)) {
    is_good = is_good && std::isfinite(s.duration_s) && s.duration_s >= 0.0 &&
              vector_of(s.force_on_hand_newton).allFinite() &&
              (s.is_end_unknown != 0 || vector_of(s.hand_position_at_end_m).allFinite());
  }
  return is_good;
}

const SettingEntry* setting_of(const char* name) {
  const auto settings = palpate::controllers::setting_catalogue();
  const auto entry = std::find_if(settings.begin(), settings.end(), [&](const SettingEntry& e) {
    return std::string_view(e.name) == name;
  });
  return entry == settings.end() ? nullptr : &*entry;
}

}  // namespace

struct palpate_controller {
  const char* name = "";  // of the catalogue
  ControllerSettings settings{};
  std::unique_ptr<ForceController> made{};
  std::array<AppliedStretch, kMostStretches> stretches{};
  bool is_next_a_gap = false;
  std::array<char, 256> error{};
};

const char* palpate_controllers_version() { return PALPATE_CONTROLLERS_VERSION; }

size_t palpate_controller_count() { return palpate::controllers::controller_catalogue().size(); }

const char* palpate_controller_name(size_t index) {
  const auto names = palpate::controllers::controller_catalogue();
  return index < names.size() ? names[index].name : nullptr;
}

size_t palpate_setting_count() { return palpate::controllers::setting_catalogue().size(); }

const char* palpate_setting_name(size_t index) {
  const auto settings = palpate::controllers::setting_catalogue();
  return index < settings.size() ? settings[index].name : nullptr;
}

const char* palpate_setting_unit(size_t index) {
  const auto settings = palpate::controllers::setting_catalogue();
  return index < settings.size() ? settings[index].unit : nullptr;
}

palpate_controller* palpate_controller_create(const char* name) {
  if (name == nullptr) return nullptr;
  for (const auto& entry : palpate::controllers::controller_catalogue()) {
    if (std::string_view(entry.name) != name) continue;
    try {
      auto controller = std::make_unique<palpate_controller>();
      controller->name = entry.name;
      controller->made = palpate::controllers::make_named(entry.name, controller->settings);
      return controller.release();
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
  }
  return nullptr;
}

void palpate_controller_destroy(palpate_controller* controller) { delete controller; }

palpate_status palpate_controller_set(palpate_controller* controller, const char* setting,
                                      double value) {
  if (controller == nullptr || setting == nullptr) return PALPATE_NULL_POINTER;
  auto& error = controller->error;
  error[0] = '\0';
  const SettingEntry* entry = setting_of(setting);
  if (entry == nullptr) {
    std::snprintf(error.data(), error.size(),
                  "%.80s: there is no such setting; palpate_setting_name lists them", setting);
    return PALPATE_UNKNOWN_NAME;
  }
  const bool is_in_range =
      std::isfinite(value) && (entry->is_least_open ? value > entry->least : value >= entry->least);
  if (!is_in_range) {
    std::snprintf(error.data(), error.size(), "%s = %g %s: must be finite and %s %g", entry->name,
                  value, entry->unit, entry->is_least_open ? ">" : "≥", entry->least);
    return PALPATE_OUT_OF_RANGE;
  }
  ControllerSettings changed = controller->settings;
  entry->set(changed, value);
  if (entry->holds != nullptr && !entry->holds(changed)) {
    std::snprintf(error.data(), error.size(), "%s = %g %s: %s", entry->name, value, entry->unit,
                  entry->rule);
    return PALPATE_OUT_OF_RANGE;
  }
  try {
    controller->made = palpate::controllers::make_named(controller->name, changed);
  } catch (const std::bad_alloc&) {
    return PALPATE_NO_MEMORY;
  }
  controller->settings = changed;
  controller->is_next_a_gap = false;
  return PALPATE_OK;
}

palpate_status palpate_controller_get(const palpate_controller* controller, const char* setting,
                                      double* value) {
  if (controller == nullptr || setting == nullptr || value == nullptr) return PALPATE_NULL_POINTER;
  const SettingEntry* entry = setting_of(setting);
  if (entry == nullptr) return PALPATE_UNKNOWN_NAME;
  *value = entry->get(controller->settings);
  return PALPATE_OK;
}

palpate_status palpate_controller_reset(palpate_controller* controller) {
  if (controller == nullptr) return PALPATE_NULL_POINTER;
  controller->made->reset();
  controller->is_next_a_gap = false;
  return PALPATE_OK;
}

palpate_status palpate_controller_step(palpate_controller* controller, const palpate_input* input,
                                       palpate_output* output) {
  if (output == nullptr) return PALPATE_NULL_POINTER;
  *output = {};
  if (controller == nullptr) return PALPATE_NULL_POINTER;
  const bool has_stretches =
      input != nullptr && (input->applied != nullptr || input->applied_count == 0);
  if (!has_stretches || !is_finite(*input)) {
    controller->is_next_a_gap = true;
    return has_stretches ? PALPATE_NOT_FINITE : PALPATE_NULL_POINTER;
  }
  const CallbackProbe probe(*input);
  const bool is_too_much = input->applied_count > kMostStretches;
  const std::size_t count = is_too_much ? 0 : input->applied_count;
  for (std::size_t i = 0; i < count; ++i) {
    const palpate_stretch& s = input->applied[i];
    controller->stretches[i] = {.duration_s = s.duration_s,
                                .force_on_hand_newton = vector_of(s.force_on_hand_newton),
                                .hand_position_at_end_m = vector_of(s.hand_position_at_end_m),
                                .has_position_at_end = s.is_end_unknown == 0};
  }
  const ControlOutput made = controller->made->step(
      {.hand_position_m = vector_of(input->hand_position_m),
       .applied = {controller->stretches.data(), count},
       .has_gap = input->has_gap != 0 || is_too_much || controller->is_next_a_gap,
       .acting_force_on_hand_newton = vector_of(input->acting_force_on_hand_newton),
       .acting_lease_s = input->acting_lease_s > 0.0 ? input->acting_lease_s
                                                     : std::numeric_limits<double>::infinity(),
       .requested_force_on_hand_newton = vector_of(input->requested_force_on_hand_newton),
       .is_request_fresh = input->is_request_held == 0,
       .stored_energy_joule = input->stored_energy_joule,
       .hand_velocity_m_per_s = vector_of(input->hand_velocity_m_per_s),
       .evaluated_at_m = vector_of(input->evaluated_at_m),
       .surface_normal = vector_of(input->surface_normal),
       .tissue = input->tissue != nullptr ? &probe : nullptr});
  controller->is_next_a_gap = false;
  put(made.force_on_hand_newton, output->force_on_hand_newton);
  put(made.f_max_newton, output->f_max_newton);
  output->ledger_energy_joule = made.ledger_energy_joule;
  output->lease_s = made.lease_s;
  output->is_clamped = made.is_clamped ? 1 : 0;
  output->is_too_fast = made.is_too_fast ? 1 : 0;
  return PALPATE_OK;
}

const char* palpate_controller_error(const palpate_controller* controller) {
  return controller == nullptr ? "" : controller->error.data();
}
