// SPDX-License-Identifier: Apache-2.0
// damiao_models.h — the motors that are known, with the ranges of their values as they are
// delivered: those of openarm_can 9866604 (2026-08-01), dm_motor_constants.hpp. None was measured.
#pragma once

#include <array>
#include <string_view>

#include "device_node/drivers/damiao/damiao_frame.h"

namespace palpate::device {

struct DamiaoModel {
  std::string_view name;
  DamiaoRange range;
};

inline constexpr std::array<DamiaoModel, 13> kDamiaoModels{{
    {"DM3507", {12.5, 50.0, 5.0}},
    {"DM4310", {12.5, 30.0, 10.0}},
    {"DM4310_48V", {12.5, 50.0, 10.0}},
    {"DM4340", {12.5, 10.0, 28.0}},
    {"DM4340_48V", {12.5, 10.0, 28.0}},
    {"DM6006", {12.5, 45.0, 20.0}},
    {"DM8006", {12.5, 45.0, 40.0}},
    {"DM8009", {12.5, 45.0, 54.0}},
    {"DM10010L", {12.5, 25.0, 200.0}},
    {"DM10010", {12.5, 20.0, 200.0}},
    {"DMH3510", {12.5, 280.0, 1.0}},
    {"DMH6215", {12.5, 45.0, 10.0}},
    {"DMG6220", {12.5, 45.0, 10.0}},
}};

/// Null: unknown.
[[nodiscard]] constexpr const DamiaoModel* damiao_model(std::string_view name) {
  for (const DamiaoModel& model : kDamiaoModels) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

}  // namespace palpate::device
