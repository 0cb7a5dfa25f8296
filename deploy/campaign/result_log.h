// SPDX-License-Identifier: Apache-2.0
// result_log.h — the results of a campaign, on disk as they come: one append-only file for each
// worker, one line for each run, each with a check sum. A line that a kill or a full disk has cut
// is no result; its run is computed again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "deploy/campaign/campaign.h"

namespace palpate::campaign {

/// Appends the results of one worker. The file belongs to one process at a time.
class ResultLog {
 public:
  /// Throws std::runtime_error if the file cannot be opened or another process has it.
  ResultLog(std::filesystem::path file, const Campaign& campaign);
  ~ResultLog();
  ResultLog(const ResultLog&) = delete;
  ResultLog& operator=(const ResultLog&) = delete;

  /// The line is in the file when this returns, whatever becomes of this process; on the disk
  /// within a second. Throws std::runtime_error if it cannot be written.
  void add(std::uint64_t run, std::span<const double> figures);

 private:
  void flush();

  std::filesystem::path file_;
  const Campaign& campaign_;
  int descriptor_;
  SteadyClock clock_;
  TimePoint flushed_at_;
};

/// All results of a campaign, read from the logs of a folder.
class Results {
 public:
  explicit Results(const Campaign& campaign);

  /// Reads what has been added to the *.log files of the folder since the last call.
  /// Throws SetupError if a line is longer than any result.
  void refresh(const std::filesystem::path& folder);

  [[nodiscard]] bool has(std::uint64_t run) const { return is_known_[run]; }
  [[nodiscard]] std::span<const double> figures(std::uint64_t run) const {
    return std::span(figures_).subspan(run * width_, width_);
  }
  /// Runs that the campaign needs: all, or up to the first that violates a limit.
  [[nodiscard]] std::uint64_t needed() const { return needed_; }
  /// Of these, the known ones.
  [[nodiscard]] std::uint64_t known() const;
  [[nodiscard]] bool is_complete() const { return known() == needed_; }
  /// The runs that are needed and not known, of one share out of `shares`.
  [[nodiscard]] std::vector<std::uint64_t> missing(std::uint64_t share = 0,
                                                   std::uint64_t shares = 1) const;
  /// Lines that were no results, and runs that were computed more than once.
  [[nodiscard]] std::uint64_t damaged_lines() const { return damaged_; }
  [[nodiscard]] std::uint64_t repeated_runs() const { return repeated_; }

 private:
  void take(std::string_view line);

  const Campaign& campaign_;
  std::size_t width_;
  std::vector<double> figures_;
  std::vector<bool> is_known_;
  std::uint64_t needed_;
  std::map<std::filesystem::path, std::uint64_t> read_;  // bytes of each file so far
  std::uint64_t damaged_ = 0;
  std::uint64_t repeated_ = 0;
};

}  // namespace palpate::campaign
