// SPDX-License-Identifier: Apache-2.0
// score_table.h — the scores of several runs beside each other, and what they say together:
// sensitivity and specificity.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/task/score.h"

namespace palpate {

struct NamedScore {
  std::string run;
  TaskScore score;
};

/// A share of counted cases with its 95 % interval [Wilson27].
struct CountedShare {
  std::uint64_t hits = 0;
  std::uint64_t cases = 0;

  [[nodiscard]] double ratio() const;  ///< NaN without cases
  [[nodiscard]] double low() const;
  [[nodiscard]] double high() const;
};

/// What a set of runs says about who searched. Only runs of searches count that
/// began and whose recording does not break off.
struct DetectionFigures {
  CountedShare sensitivity;  ///< lesions that were found
  CountedShare specificity;  ///< of the runs without a lesion those without a mark
  std::uint64_t runs = 0;
  std::uint64_t false_alarms = 0;
};
[[nodiscard]] DetectionFigures detection_of(const std::vector<NamedScore>& scores);

/// What tells the runs apart: of each path its last folders and the file, as few as are needed.
[[nodiscard]] std::vector<std::string> short_names(const std::vector<NamedScore>& scores);

/// Of a needle or a traction; "" of others.
[[nodiscard]] std::string outcome_of(const TaskScore& score);
/// One line a run, and below it the detection of all.
[[nodiscard]] std::string table_text(const std::vector<NamedScore>& scores);
/// One column a run, one line a figure.
[[nodiscard]] std::string compared_text(const std::vector<NamedScore>& scores);
/// One row a run; columns: docs/tasks.md.
[[nodiscard]] std::string table_csv(const std::vector<NamedScore>& scores);
/// One row for each lesion, for the rest of the surface and for each layer of each run; columns:
/// docs/tasks.md.
[[nodiscard]] std::string regions_csv(const std::vector<NamedScore>& scores);
/// {"runs": {NAME: score}, "detection": …}
[[nodiscard]] nlohmann::ordered_json table_json(const std::vector<NamedScore>& scores);

}  // namespace palpate
