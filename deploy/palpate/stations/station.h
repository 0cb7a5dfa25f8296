// SPDX-License-Identifier: Apache-2.0
// station.h — what viewer_nodes of other machines say of the tasks that are done there.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/core/time.h"

namespace palpate {

/// Where the page of a station is.
struct Station {
  std::string name;
  std::string host;
  std::string port = "8765";
  std::string token{};
};

/// "http://HOST:PORT/?token=…", with "NAME=" before it where the host is not name enough. Throws
/// SetupError.
[[nodiscard]] Station station_of(const std::string& text);

/// The answer of a station to GET /task, or why there is none.
struct StationAnswer {
  std::optional<nlohmann::json> task{};  ///< {"session": …, "task": …}
  std::string problem{};
};

/// Asks all at once. @param patience  for each
[[nodiscard]] std::vector<StationAnswer> ask(const std::vector<Station>& stations,
                                             Duration patience);

/// One line a station; a long result is cut between words.
[[nodiscard]] std::string stations_text(const std::vector<Station>& stations,
                                        const std::vector<StationAnswer>& answers);
/// One row a station. An unknown value is empty.
[[nodiscard]] std::string stations_csv(const std::vector<Station>& stations,
                                       const std::vector<StationAnswer>& answers);
/// {"stations": [{"name": …, "state": …, "cells": [time, marks, coverage, force, missing, news]}]}
[[nodiscard]] std::string stations_json(const std::vector<Station>& stations,
                                        const std::vector<StationAnswer>& answers);

}  // namespace palpate
