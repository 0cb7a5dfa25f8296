// SPDX-License-Identifier: Apache-2.0
/// @file
/// catalogue.h — every controller by name, from one flat set of settings: for programs that choose
/// at run time, and for the C interface.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "own_controllers.h"

namespace palpate::controllers {

/// One field of the settings, by name.
struct SettingEntry {
  const char* name;  ///< of the field
  const char* unit;  ///< "1" for a plain number
  /// Its value; of friction per axis 0 where there is none.
  double (*get)(const ControllerSettings&);
  /// Changes it, without a check.
  void (*set)(ControllerSettings&, double);
  double least;                                        ///< allowed: ≥ least, or > least
  bool is_least_open;                                  ///< true: > least
  bool (*holds)(const ControllerSettings&) = nullptr;  ///< a rule with other settings, or nullptr
  const char* rule = nullptr;                          ///< that rule in words, for an error
};

/// Every setting that has a name.
[[nodiscard]] std::span<const SettingEntry> setting_catalogue() noexcept;
/// Every controller that can be chosen by name alone.
[[nodiscard]] std::span<const ControllerEntry> controller_catalogue() noexcept;

/// Makes a controller, behind mode guard where settings.safety_net ≠ 0. Does not check the
/// settings: SettingEntry has their rules.
/// @param name  of controller_catalogue(), or "wave_variables", which also needs the other end of
///              the channel (ControlInput::returned_wave)
/// @param settings  of which the controller reads its own
/// @return nullptr for any other name
[[nodiscard]] std::unique_ptr<ForceController> make_named(std::string_view name,
                                                          const ControllerSettings& settings);

}  // namespace palpate::controllers
