// json_output.h — where --json goes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace palpate {

/// A file, "-" for standard output, or nowhere.
class JsonOutput {
 public:
  /// Made before a run, so that a path that cannot be written is told before it, not after it; what
  /// the file holds stays until write(). Throws SetupError.
  explicit JsonOutput(const std::string& path);

  [[nodiscard]] bool is_standard_output() const { return path_ == "-"; }
  /// Throws std::runtime_error if the file cannot take it.
  void write(const nlohmann::ordered_json& json) const;

 private:
  std::string path_;  // empty: nowhere
};

}  // namespace palpate
