// SPDX-License-Identifier: Apache-2.0
// task_journal.h — what the score of a task is made of, kept in a file while the run lasts, so that
// a viewer_node that is started again after a crash knows what the one before it has seen.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include "common/telemetry/tick_row.h"

namespace palpate::viewer {

/// One process at a time: a second one with the same file keeps nothing, as does one whose disk is
/// full. The file is removed by a process that ends as it should.
class TaskJournal {
 public:
  static constexpr std::size_t kMostBytes = std::size_t{128} << 20U;  ///< 20 minutes at 1 kHz

  /// @param file  in a folder that nobody else may write
  explicit TaskJournal(const std::filesystem::path& file);
  ~TaskJournal();
  TaskJournal(const TaskJournal&) = delete;
  TaskJournal& operator=(const TaskJournal&) = delete;

  /// Whether a process before has kept rows of the same device from before `next`. If not, the file
  /// begins anew. Call it once, first.
  [[nodiscard]] bool continues(const TickRow& next);
  /// Hands over these rows, in order, with what TaskEvaluator takes of them.
  void replay(const std::function<void(const TickRow&)>& take) const;
  /// The file has it after 0.2 s at most, if more rows follow.
  void append(const TickRow& row);
  /// Forgets all rows.
  void clear();
  [[nodiscard]] std::size_t size_bytes() const { return size_bytes_; }

 private:
  void cut(std::size_t size_bytes);
  void write();
  void close();

  std::filesystem::path file_;
  int descriptor_ = -1;  // -1: nothing is kept
  std::vector<std::byte> buffer_;
  std::size_t size_bytes_ = 0;
  std::size_t kept_rows_ = 0;  // of the process before
  TimePoint written_at_{};
};

}  // namespace palpate::viewer
