// SPDX-License-Identifier: Apache-2.0
// finding.h — what a conformance suite has found.
#pragma once

#include <functional>
#include <string>

namespace palpate {

struct ConformFinding {
  std::string check;  ///< "stamps"
  bool is_good = false;
  std::string text;         ///< what was found
  std::string remedy = {};  ///< empty if it is good
  bool is_checked = true;   ///< false: it cannot be observed or judged; is_good says nothing
};

/// As --json has it. @tparam Json  of nlohmann
template <class Json>
void to_json(Json& json, const ConformFinding& found) {
  json = {{"check", found.check},
          {"is_checked", found.is_checked},
          {"is_good", found.is_good},
          {"text", found.text},
          {"remedy", found.remedy}};
}
/// Throws nlohmann::json::exception if something is missing.
template <class Json>
void from_json(const Json& json, ConformFinding& found) {
  json.at("check").get_to(found.check);
  json.at("is_checked").get_to(found.is_checked);
  json.at("is_good").get_to(found.is_good);
  json.at("text").get_to(found.text);
  json.at("remedy").get_to(found.remedy);
}

/// Called for each, in order.
using OnFinding = std::function<void(const ConformFinding&)>;

}  // namespace palpate
