// SPDX-License-Identifier: Apache-2.0
// campaign.h — many runs of one session, as plain structs, checked; read from a file
// (proto/palpate/v1/campaign.proto). And each of its runs: what it overrides, whether it is within
// the limits. A run is determined by its number alone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "deploy/campaign/quantities.h"

namespace palpate::campaign {

/// One of the cartesian values of a dimension.
struct Value {
  std::string label;
  std::vector<std::string> overrides;
};

struct Dimension {
  enum class Kind : std::uint8_t { kCartesian, kChoice, kUniform, kLogUniform };
  std::string name;   ///< column of the results
  std::string field;  ///< of the session; empty for options
  Kind kind = Kind::kCartesian;
  std::vector<Value> values;  ///< cartesian and choice
  double low = 0.0;
  double high = 0.0;
};

/// Bounds of one quantity. NaN satisfies them.
struct Bounds {
  std::size_t quantity = 0;  ///< index in Campaign::quantities
  std::optional<double> at_least{};
  std::optional<double> at_most{};

  [[nodiscard]] bool hold(std::span<const double> figures) const {
    const double value = figures[quantity];
    return !(at_least && value < *at_least) && !(at_most && value > *at_most);
  }
  [[nodiscard]] std::string text(const std::vector<const Quantity*>& quantities) const;
};

struct Limit {
  Bounds bounds;
  std::vector<Bounds> where;

  [[nodiscard]] bool applies(std::span<const double> figures) const;
  [[nodiscard]] bool is_violated(std::span<const double> figures) const {
    return applies(figures) && !bounds.hold(figures);
  }
};

/// What tells, without reading it, whether a file is still the one that it was.
struct FileMark {
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
  std::int64_t bytes = 0;
  std::int64_t modified_ns = 0;
  std::int64_t changed_ns = 0;  ///< cannot be set back by a program

  bool operator==(const FileMark&) const = default;
};
/// Zeros if the file is not there.
[[nodiscard]] FileMark mark_of(const std::string& file);

struct Campaign {
  std::string name;
  std::filesystem::path file;
  std::filesystem::path session_file;
  std::vector<std::string> files;  ///< all that are read: the campaign, the session, what it names
  std::vector<std::string> overrides;
  double seconds = 0.0;
  std::vector<Dimension> dimensions;
  bool is_hostile = false;
  bool has_lying_clamp = false;
  bool has_hostile_wrist = false;
  std::uint64_t runs_per_cell = 1;
  std::uint64_t first_seed = 1;
  std::vector<const Quantity*> quantities;  ///< those to report, then those that only limits use
  std::size_t reported = 0;                 ///< of `quantities`
  std::vector<Limit> limits;
  bool stops_at_violation = false;
  /// Of everything that determines the figures of a run: the campaign but for the number of its
  /// runs, the session, the files that it and any override name, and this program with its library
  /// of controllers.
  std::uint64_t fingerprint = 0;
  /// The files that runs read, as they were before the fingerprint was taken.
  std::map<std::string, FileMark> marks;

  [[nodiscard]] std::uint64_t cells() const;
  [[nodiscard]] std::uint64_t run_count() const { return cells() * runs_per_cell; }
  [[nodiscard]] bool needs_ideal() const;
  [[nodiscard]] bool is_violated(std::span<const double> figures) const;
};

/// Of name and content; of the name alone where the file cannot be read.
[[nodiscard]] std::uint64_t hash_of_file(const std::filesystem::path& file);

/// Reads and checks the campaign and the session of its first run in every cell (of the first 1000
/// cells). Throws SetupError.
/// @param runs  instead of those of the file
[[nodiscard]] Campaign load_campaign(const std::filesystem::path& file,
                                     std::optional<std::uint64_t> runs = {});

/// What distinguishes one run.
struct Plan {
  std::uint64_t run = 0;  ///< cell · runs_per_cell + i
  std::uint64_t seed = 0;
  std::vector<std::string> overrides;  ///< all that differ from the session file
  std::vector<std::string> labels;     ///< of each dimension
};
[[nodiscard]] Plan plan_of(const Campaign& campaign, std::uint64_t run);

/// "palpate loopback SESSION --seconds 2 --set …", which repeats the run.
[[nodiscard]] std::string command_line(const Campaign& campaign, const Plan& plan);

/// The figures of a run, in the order of Campaign::quantities. Throws SetupError if the session of
/// the run is refused, or if a file that it may have read is no longer that of the fingerprint.
/// @param mcap_file  records the run; empty: not
[[nodiscard]] std::vector<double> compute(const Campaign& campaign, const Plan& plan,
                                          const std::string& mcap_file = {},
                                          bool may_overwrite = false);

}  // namespace palpate::campaign
