// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engine_process/launched_session.h"

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/core/check.h"

namespace palpate::physics {

std::optional<LaunchedSession> launched_session() {
  const char* text = std::getenv("PALPATE_PHYSICS");
  if (text == nullptr) return std::nullopt;
  const auto json = nlohmann::json::parse(text, nullptr, false);
  try {
    return LaunchedSession{.file = json.at("session").get<std::string>(),
                           .overrides = json.at("overrides").get<std::vector<std::string>>(),
                           .is_insecure = json.value("insecure", false)};
  } catch (const nlohmann::json::exception& error) {
    throw SetupError("PALPATE_PHYSICS: " + std::string(error.what()) +
                     "; it is set by `palpate launch`: unset it, and give --session FILE");
  }
}

}  // namespace palpate::physics
