// SPDX-License-Identifier: Apache-2.0
// plan.h — what a study consists of: the session of its trials, what is compared, and how the
// difficulty follows the answers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::study {

struct Condition {
  std::string name;
  std::vector<std::string> overrides;
};

/// A transformed up-down staircase [Levitt71].
struct StaircasePlan {
  std::string field;       ///< of the session: set to reference · (1 + difference)
  double reference = 1.0;  ///< > 0
  double start_ratio = 0.5;
  double step_factor = 1.26;
  std::uint64_t right_answers = 2;  ///< in a row, until the difference falls
  std::uint64_t reversals = 10;     ///< until it ends
  std::uint64_t most_trials = 80;
  double most_ratio = 100.0;  ///< the difference does not grow beyond: every session takes it
  std::vector<std::vector<std::string>> alternatives{};  ///< overrides of each
};

struct Plan {
  std::filesystem::path file;
  std::filesystem::path session_file;
  std::string name;
  std::vector<std::string> overrides;
  std::vector<Condition> conditions;  ///< at least one
  std::uint64_t repeats = 1;
  std::optional<double> seconds{};  ///< of a trial at most
  std::uint64_t seed = 1;
  std::optional<StaircasePlan> staircase{};
  std::uint64_t fingerprint = 0;     ///< of the plan and of every file that its sessions name
  std::vector<std::string> files{};  ///< that it is made of, besides its own
  std::vector<std::string> notes{};  ///< what whoever does the trials should know

  /// Of a trial, as --set has them. @param alternative, difference_ratio  with a staircase
  [[nodiscard]] std::vector<std::string> overrides_of(std::size_t condition,
                                                      std::size_t alternative,
                                                      double difference_ratio) const;
};

/// Reads a plan and every session that it makes. Throws SetupError with all that is wrong.
[[nodiscard]] Plan load_plan(const std::filesystem::path& file);

}  // namespace palpate::study
