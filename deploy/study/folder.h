// SPDX-License-Identifier: Apache-2.0
// folder.h — what a study has measured so far: one folder a participant, one a trial, and nothing
// that says who the participant is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/task/score.h"
#include "deploy/study/key.h"
#include "deploy/study/order.h"
#include "deploy/study/plan.h"
#include "deploy/study/staircase.h"

namespace palpate::study {

/// A row of a trial that is done.
struct TrialRow {
  std::uint64_t participant = 0;
  std::string code;                ///< of its condition
  std::optional<bool> is_right{};  ///< with a staircase
  std::string cells;               ///< all of them, as in the file
};

/// Trials that are done and count in nothing, since one before them is missing.
struct LeftOut {
  std::filesystem::path missing;           ///< row of that one
  std::vector<std::uint64_t> trials = {};  ///< numbers of those behind it
};

class Folder {
 public:
  /// Creates it, with a key of its own for people (`key.csv`) and for the simulated
  /// (`key_simulated.csv`), or takes one that the same study has left. Throws SetupError if it
  /// belongs to another study or to another content of this one, or has lost its key.
  /// @param is_simulated  of participants that are simulated: they are kept apart from people
  Folder(std::filesystem::path path, const Plan& plan, bool is_simulated);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path folder_of(std::uint64_t participant) const;
  /// Made empty: what a trial that was cut off has left is gone.
  [[nodiscard]] std::filesystem::path begin(const Trial& trial) const;
  /// The trial is done from then on. Throws std::runtime_error if it cannot be written.
  void keep(const Trial& trial, const TaskScore& score, std::optional<bool> is_right) const;
  /// Of the trials that are done, in order.
  [[nodiscard]] std::vector<TrialRow> rows(std::uint64_t participant) const;
  [[nodiscard]] bool is_simulated() const { return is_simulated_; }
  [[nodiscard]] const Key& key() const { return key_; }
  /// Who has done at least one trial, of people or of the simulated.
  [[nodiscard]] std::vector<std::uint64_t> participants() const;
  /// Of those whose folders have a trial behind one that is missing.
  [[nodiscard]] std::vector<LeftOut> left_out() const;

  /// The files of the folder, and those of its trials.
  [[nodiscard]] std::vector<std::string> files() const;

  /// Of row files.
  [[nodiscard]] static std::string header();

 private:
  void create() const;
  /// Whose folder is there, in order.
  [[nodiscard]] std::vector<std::uint64_t> folders() const;
  [[nodiscard]] std::string cells_before_answer(const Trial& trial) const;
  [[nodiscard]] TrialRow row_in(const std::filesystem::path& file,
                                const std::optional<Trial>& trial) const;
  [[nodiscard]] std::filesystem::path trial_folder(std::uint64_t participant,
                                                   std::uint64_t number) const;

  std::filesystem::path path_;
  const Plan& plan_;
  bool is_simulated_;
  Key key_;
};

/// Nobody else does the trials of the participant meanwhile. Throws SetupError if somebody does.
class ParticipantLock {
 public:
  ParticipantLock(const Folder& folder, std::uint64_t participant);
  ~ParticipantLock();
  ParticipantLock(const ParticipantLock&) = delete;
  ParticipantLock& operator=(const ParticipantLock&) = delete;

 private:
  int lock_;
};

/// What a participant does next, from what he has done.
class Series {
 public:
  /// @param plan  must outlive it
  /// @param square  of the key of the folder
  Series(const Plan& plan, const std::vector<std::size_t>& square, std::uint64_t participant);

  /// None: all is done.
  [[nodiscard]] std::optional<Trial> next() const;
  /// next() is done. @param is_right  with a staircase
  void take(std::optional<bool> is_right);
  /// Of a staircase: of the conditions that are done or begun, in the order of the participant.
  [[nodiscard]] const std::vector<Staircase>& staircases() const { return staircases_; }
  [[nodiscard]] const std::vector<std::size_t>& order() const { return order_; }

 private:
  const Plan& plan_;
  std::uint64_t participant_;
  std::vector<std::size_t> order_;
  std::vector<Staircase> staircases_;
  std::uint64_t done_ = 0;
  std::size_t block_ = 0;
  std::uint64_t in_block_ = 0;
};

}  // namespace palpate::study
