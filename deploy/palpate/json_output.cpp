#include "deploy/palpate/json_output.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "common/core/check.h"

namespace palpate {

JsonOutput::JsonOutput(const std::string& path) : path_(path) {
  if (path_.empty() || is_standard_output()) return;
  if (!std::ofstream(path_, std::ios::app)) {
    throw SetupError("json file " + path_ + ": " + std::strerror(errno) +
                     ": give a path in a folder that exists and is writable");
  }
}

void JsonOutput::write(const nlohmann::ordered_json& json) const {
  const std::string text = json.dump(2) + "\n";
  if (path_.empty()) return;
  if (is_standard_output()) {
    std::fputs(text.c_str(), stdout);
    return;
  }
  std::ofstream file(path_);
  file << text;
  file.close();
  if (!file) throw std::runtime_error("json file " + path_ + ": " + std::strerror(errno));
}

}  // namespace palpate
