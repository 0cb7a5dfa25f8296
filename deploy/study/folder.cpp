// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/folder.h"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "common/core/check.h"
#include "common/core/random.h"
#include "common/core/user/files.h"
#include "common/core/user/output_file.h"
#include "common/task/score_table.h"

namespace palpate::study {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = 100'000;
constexpr const char* kOwnColumns =
    "study,participant,simulated,trial,block,trial_in_block,code,difference_ratio,alternative,"
    "right,";
constexpr std::size_t kCodeCell = 6;
constexpr std::size_t kRightCell = 9;
constexpr const char* kChecksum = "# checksum ";
constexpr const char* kMarkFile = "study.txt";
constexpr const char* kRowFile = "row.csv";
constexpr const char* kKeyFile = "key.csv";
constexpr const char* kSimulatedKeyFile = "key_simulated.csv";

void write_whole(const fs::path& file, const std::string& text) {
  OutputFile out("study", file.string(), OutputFile::Kind::kWhole, true);
  if (!out.write(text) || !out.close()) throw std::runtime_error(out.complaint());
}

/// Of what is written meanwhile nobody but this user reads anything.
class OnlyForThisUser {
 public:
  OnlyForThisUser() : before_(::umask(S_IRWXG | S_IRWXO)) {}
  ~OnlyForThisUser() { ::umask(before_); }
  OnlyForThisUser(const OnlyForThisUser&) = delete;
  OnlyForThisUser& operator=(const OnlyForThisUser&) = delete;

 private:
  mode_t before_;
};

/// Two that begin a study at once make its folder one after the other. A file system without locks
/// has none.
class Lock {
 public:
  explicit Lock(const fs::path& folder)
      : lock_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (lock_ >= 0) ::flock(lock_, LOCK_EX);
  }
  ~Lock() {
    if (lock_ >= 0) ::close(lock_);
  }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int lock_;
};

/// Of the study's own cells, none of which is quoted.
std::vector<std::string> own_cells(const std::string& row) {
  std::vector<std::string> cells;
  std::istringstream in(row);
  std::string cell;
  while (cells.size() <= kRightCell && std::getline(in, cell, ',')) cells.push_back(cell);
  return cells;
}

std::string checksum_line(const std::string& text) {
  return fmt::format("{}{:016x}\n", kChecksum, fnv1a(text));
}

std::string after_first_cell(const std::string& row) { return row.substr(row.find(',') + 1); }

std::string figure_cells(const TaskScore& score) {
  const std::string table = palpate::table_csv({{.run = "", .score = score}});
  return after_first_cell(table.substr(table.find('\n') + 1));
}

}  // namespace

std::string Folder::header() {
  const std::string table = palpate::table_csv({});
  return kOwnColumns + after_first_cell(table);
}

Folder::Folder(fs::path path, const Plan& plan, bool is_simulated)
    : path_(std::move(path)), plan_(plan), is_simulated_(is_simulated) {
  create();
  key_ = key_in(path_ / (is_simulated_ ? kSimulatedKeyFile : kKeyFile), plan_);
}

/// If it is not there.
void Folder::create() const {
  const fs::path mark = path_ / kMarkFile;
  const std::string content =
      fmt::format("study {}\nfingerprint {:016x}\n", plan_.name, plan_.fingerprint);
  std::error_code error;
  fs::create_directories(path_, error);
  if (error) {
    throw SetupError(path_.string() + ": " + error.message() +
                     "; give another folder with --folder");
  }
  const Lock lock(path_);
  if (fs::exists(mark, error)) {
    if (read_text_file(mark, kMostBytes).bytes == content) return;
    throw SetupError(path_.string() +
                     ": holds the results of another study, or the plan, its session or a file of "
                     "it has changed since; give another folder with --folder");
  }
  if (fs::exists(path_ / kKeyFile, error) || fs::exists(path_ / kSimulatedKeyFile, error)) {
    throw SetupError(path_.string() +
                     ": has a key but no study.txt: it was cut off while it was made, or that file "
                     "is lost; put study.txt back if there are trials in it, else remove the "
                     "folder, or give another one with --folder");
  }
  if (!fs::is_empty(path_, error)) {
    throw SetupError(path_.string() +
                     ": is no folder of a study and not empty; give another one with --folder");
  }
  {
    const OnlyForThisUser mine;
    for (const char* const name : {kKeyFile, kSimulatedKeyFile}) {
      write_whole(path_ / name, key_text(plan_, dealt_key(plan_.conditions.size())));
    }
  }
  write_whole(mark, content);
}

fs::path Folder::folder_of(std::uint64_t participant) const {
  return path_ / fmt::format("{}{:03}", is_simulated_ ? 'S' : 'P', participant);
}

fs::path Folder::trial_folder(std::uint64_t participant, std::uint64_t number) const {
  return folder_of(participant) / fmt::format("trial_{:03}", number);
}

fs::path Folder::begin(const Trial& trial) const {
  fs::path folder = trial_folder(trial.participant, trial.number);
  std::error_code error;
  fs::remove_all(folder, error);
  if (!error) fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": " + error.message());
  return folder;
}

void Folder::keep(const Trial& trial, const TaskScore& score, std::optional<bool> is_right) const {
  const std::string text = header() + cells_before_answer(trial) +
                           (!plan_.staircase           ? ","
                            : is_right.value_or(false) ? "1,"
                                                       : "0,") +
                           figure_cells(score);
  write_whole(trial_folder(trial.participant, trial.number) / kRowFile, text + checksum_line(text));
}

/// What a row begins with, known before the trial.
std::string Folder::cells_before_answer(const Trial& trial) const {
  std::string cells =
      fmt::format("{},{},{},{},{},{},{},", plan_.name, trial.participant, is_simulated_ ? 1 : 0,
                  trial.number, trial.block + 1, trial.in_block + 1, key_.codes[trial.condition]);
  cells += plan_.staircase
               ? fmt::format("{:.9g},{},", trial.difference_ratio, trial.alternative + 1)
               : ",,";
  return cells;
}

std::vector<TrialRow> Folder::rows(std::uint64_t participant) const {
  std::vector<TrialRow> rows;
  Series series(plan_, key_.square, participant);
  for (std::uint64_t number = 1;; ++number) {
    const fs::path file = trial_folder(participant, number) / kRowFile;
    std::error_code error;
    if (!fs::exists(file, error)) return rows;
    const auto trial = series.next();
    rows.push_back(row_in(file, trial));
    series.take(rows.back().is_right);
  }
}

/// @param trial  whose it is; none: the plan has no more
TrialRow Folder::row_in(const fs::path& file, const std::optional<Trial>& trial) const {
  const auto refuse = [&](const std::string& what) {
    throw SetupError(file.string() + ": " + what +
                     "remove the folder of the trial, and those after it, to do them again");
  };
  if (!trial) refuse("is one trial more than the plan has; ");
  const std::string text = read_text_file(file, kMostBytes).bytes;
  const std::size_t begin = header().size();
  const std::size_t end = text.find('\n', begin) + 1;
  const std::vector<std::string> cells =
      own_cells(text.starts_with(header()) && end > 0 ? text.substr(begin, end - begin) : "");
  if (cells.size() <= kRightCell) refuse("is no row of this study; ");
  const std::string rest = text.substr(end);
  // older rows have no checksum
  if (!rest.empty() && rest != checksum_line(text.substr(0, end))) {
    refuse(
        "its numbers are not those that were measured: it was edited or is damaged; put the "
        "right row back, or ");
  }
  TrialRow row{.participant = trial->participant,
               .code = cells[kCodeCell],
               .cells = text.substr(begin, end - begin)};
  if (!cells[kRightCell].empty()) row.is_right = cells[kRightCell] == "1";
  if (row.code != key_.codes[trial->condition]) {
    refuse("its code is not that of the key; put back the key that was made with this folder, or ");
  }
  if (!row.cells.starts_with(cells_before_answer(*trial))) {
    refuse(
        "is the row of another trial: participant, number, block and difference do not follow "
        "from the rows before; put the right row back, or ");
  }
  return row;
}

std::vector<std::uint64_t> Folder::folders() const {
  std::vector<std::uint64_t> found;
  for (const auto& entry : fs::directory_iterator(path_)) {
    const std::string name = entry.path().filename().string();
    const bool is_number = name.size() > 1 && name[0] == (is_simulated_ ? 'S' : 'P') &&
                           name.find_first_not_of("0123456789", 1) == std::string::npos;
    if (!is_number || name.size() >= 10) continue;
    const std::uint64_t participant = std::stoull(name.substr(1));
    // S1 beside S001 is a copy
    if (folder_of(participant).filename() == name) found.push_back(participant);
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::uint64_t> Folder::participants() const {
  std::vector<std::uint64_t> found = folders();
  std::erase_if(found, [&](std::uint64_t participant) {
    std::error_code error;
    return !fs::exists(trial_folder(participant, 1) / kRowFile, error);
  });
  return found;
}

std::vector<LeftOut> Folder::left_out() const {
  std::vector<LeftOut> all;
  for (const std::uint64_t participant : folders()) {
    std::vector<std::uint64_t> done;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder_of(participant), error)) {
      const std::string name = entry.path().filename().string();
      const std::uint64_t number = std::strtoull(name.substr(name.find('_') + 1).c_str(), {}, 10);
      const bool is_trial = trial_folder(participant, number).filename() == name;
      if (is_trial && fs::exists(entry.path() / kRowFile, error)) done.push_back(number);
    }
    std::sort(done.begin(), done.end());
    std::size_t counted = 0;
    while (counted < done.size() && done[counted] == counted + 1) ++counted;
    if (counted == done.size()) continue;
    all.push_back({.missing = trial_folder(participant, counted + 1) / kRowFile,
                   .trials = {done.begin() + static_cast<std::ptrdiff_t>(counted), done.end()}});
  }
  return all;
}

std::vector<std::string> Folder::files() const {
  std::vector<std::string> files;
  for (const char* const name : {kMarkFile, kKeyFile, kSimulatedKeyFile}) {
    files.push_back((path_ / name).string());
  }
  for (const auto& participant : fs::directory_iterator(path_)) {
    std::error_code error;  // it is no folder
    for (const auto& trial : fs::directory_iterator(participant.path(), error)) {
      for (const auto& file : fs::directory_iterator(trial.path(), error)) {
        files.push_back(file.path().string());
      }
    }
  }
  return files;
}

ParticipantLock::ParticipantLock(const Folder& folder, std::uint64_t participant) {
  const fs::path own = folder.folder_of(participant);
  std::error_code error;
  {
    const OnlyForThisUser mine;  // recordings and messages hold the condition
    fs::create_directory(own, error);
  }
  if (error) {
    throw SetupError(own.string() + ": cannot be made: " + error.message() +
                     "; make that place writable, or give another folder with --folder");
  }
  lock_ = ::open((own / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (lock_ < 0) {
    throw SetupError(own.string() + ": " + std::generic_category().message(errno) +
                     "; give another folder with --folder");
  }
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock_);
    throw SetupError(own.string() +
                     ": another `palpate study` does the trials of this participant; wait for it");
  }
}

ParticipantLock::~ParticipantLock() { ::close(lock_); }

// --- series -------------------------------------------------------------------------------------

Series::Series(const Plan& plan, const std::vector<std::size_t>& square, std::uint64_t participant)
    : plan_(plan), participant_(participant), order_(order_of(square, participant)) {
  if (plan.staircase) staircases_.emplace_back(*plan.staircase);
}

std::optional<Trial> Series::next() const {
  if (block_ == order_.size()) return std::nullopt;
  Trial trial{.participant = participant_,
              .number = done_ + 1,
              .block = block_,
              .condition = order_[block_],
              .in_block = in_block_};
  if (plan_.staircase) {
    trial.alternative = Random(trial.seed(plan_)).below(plan_.staircase->alternatives.size());
    trial.difference_ratio = staircases_.back().difference_ratio();
  }
  return trial;
}

void Series::take(std::optional<bool> is_right) {
  ++done_;
  ++in_block_;
  bool is_block_done = in_block_ == plan_.repeats;
  if (plan_.staircase) {
    staircases_.back().answer(is_right.value_or(false));
    is_block_done = staircases_.back().is_done();
  }
  if (!is_block_done) return;
  ++block_;
  in_block_ = 0;
  if (plan_.staircase && block_ < order_.size()) staircases_.emplace_back(*plan_.staircase);
}

}  // namespace palpate::study
