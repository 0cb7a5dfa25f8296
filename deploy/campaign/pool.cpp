// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/pool.h"

#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <map>
#include <new>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

#include "common/core/check.h"

namespace palpate::campaign {
namespace {

constexpr std::size_t kRunsPerClaim = 4;
constexpr unsigned kMostWorkers = 1024;
constexpr int kMostDeaths = 3;  // that one run may cause
constexpr std::uint64_t kNoRun = ~std::uint64_t{0};

enum ExitStatus : int { kDone = 0, kRefused = 2, kFailed = 3 };

/// In memory that all processes share. A worker that is killed leaves it whole.
struct Board {
  std::atomic<std::uint64_t> next{0};         ///< claim
  std::atomic<std::uint64_t> done{0};         ///< runs
  std::atomic<std::uint64_t> needed{kNoRun};  ///< runs below it
  std::atomic<bool> is_ended{false};
  std::array<std::atomic<std::uint64_t>, kMostWorkers> current{};  ///< run of each worker
  std::atomic<bool> has_complaint{false};
  std::array<char, 8192> complaint{};  ///< of the first worker that failed
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

class SharedBoard {
 public:
  SharedBoard()
      : memory_(::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS,
                       -1, 0)) {
    if (memory_ == MAP_FAILED) {
      throw std::system_error(errno, std::generic_category(), "memory for the workers");
    }
    board_ = new (memory_) Board;
  }
  ~SharedBoard() { ::munmap(memory_, sizeof(Board)); }
  SharedBoard(const SharedBoard&) = delete;
  SharedBoard& operator=(const SharedBoard&) = delete;
  Board* operator->() { return board_; }
  Board& operator*() { return *board_; }

 private:
  void* memory_;
  Board* board_ = nullptr;
};

/// Computes one run and notes it. True if it is the first one that ends the campaign so far.
bool compute_one(const Campaign& campaign, std::uint64_t run, ResultLog& log) {
  const Plan plan = plan_of(campaign, run);
  std::vector<double> figures;
  try {
    figures = compute(campaign, plan);
  } catch (const std::exception& error) {
    const std::string text =
        fmt::format("run {}: {}\n  {}", run, error.what(), command_line(campaign, plan));
    if (dynamic_cast<const SetupError*>(&error) != nullptr) throw SetupError(text);
    throw std::runtime_error(text);
  }
  log.add(run, figures);
  return campaign.stops_at_violation && campaign.is_violated(figures);
}

void lower(std::atomic<std::uint64_t>& value, std::uint64_t to) {
  std::uint64_t seen = value;
  while (to < seen && !value.compare_exchange_weak(seen, to)) {
  }
}

/// The life of a worker process.
[[noreturn]] void work(const Campaign& campaign, const std::filesystem::path& log_file,
                       const std::vector<std::uint64_t>& runs, unsigned worker, Board& board) {
  int status = kDone;
  std::string complaint;
  try {
    ResultLog log(log_file, campaign);
    for (;;) {
      const std::size_t begin = kRunsPerClaim * board.next.fetch_add(1);
      if (begin >= runs.size()) break;
      for (std::size_t i = begin; i < std::min(begin + kRunsPerClaim, runs.size()); ++i) {
        if (board.is_ended) break;
        if (runs[i] >= board.needed) continue;
        board.current[worker] = runs[i];
        if (compute_one(campaign, runs[i], log)) lower(board.needed, runs[i] + 1);
        board.current[worker] = kNoRun;
        ++board.done;
      }
      if (board.is_ended) break;
    }
  } catch (const SetupError& error) {
    status = kRefused;
    complaint = error.what();
  } catch (const std::exception& error) {
    status = kFailed;
    complaint = error.what();
  }
  if (status != kDone && !board.has_complaint.exchange(true)) {
    std::strncpy(board.complaint.data(), complaint.c_str(), board.complaint.size() - 1);
  }
  ::_exit(status);
}

/// The workers of one round over a list of runs.
class Workers {
 public:
  Workers(const Campaign& campaign, const Folder& folder, const std::vector<std::uint64_t>& runs,
          std::map<std::uint64_t, int>& deaths)
      : campaign_(campaign), folder_(folder), runs_(runs), deaths_(deaths) {}
  ~Workers() {
    for (const auto& [pid, worker] : alive_) ::kill(pid, SIGKILL);
    for (const auto& [pid, worker] : alive_) ::waitpid(pid, nullptr, 0);
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  void start(unsigned worker) {
    board_->current[worker] = kNoRun;
    const std::filesystem::path log = folder_.path() / fmt::format("worker-{}.log", worker);
    const pid_t parent = ::getpid();
    const pid_t pid = ::fork();
    if (pid < 0) throw std::system_error(errno, std::generic_category(), "a worker process");
    if (pid == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != parent) ::_exit(kDone);
      work(campaign_, log, runs_, worker, *board_);
    }
    alive_[pid] = worker;
  }

  /// Takes note of workers that have ended, and replaces those that were killed.
  void reap() {
    for (;;) {
      int status = 0;
      const pid_t pid = ::waitpid(-1, &status, WNOHANG);
      if (pid <= 0) return;
      const auto ended = alive_.find(pid);
      if (ended == alive_.end()) continue;
      const unsigned worker = ended->second;
      alive_.erase(ended);
      if (WIFSIGNALED(status)) {
        blame(board_->current[worker], WTERMSIG(status));
        if (!board_->is_ended) start(worker);
      } else if (WEXITSTATUS(status) == kRefused) {
        throw SetupError(board_->complaint.data());
      } else if (WEXITSTATUS(status) != kDone) {
        throw std::runtime_error(board_->complaint.data());
      }
    }
  }

  void end() { board_->is_ended = true; }
  [[nodiscard]] bool is_any_alive() const { return !alive_.empty(); }
  [[nodiscard]] std::uint64_t done() { return board_->done; }

 private:
  /// SIGKILL may come from anyone; a run that crashes does so again.
  void blame(std::uint64_t run, int signal) {
    if (run == kNoRun || signal == SIGTERM) return;
    if (++deaths_[run] < kMostDeaths) return;
    throw std::runtime_error(
        fmt::format("run {} ended its worker {} times, last by signal {}:\n  {}", run, kMostDeaths,
                    signal, command_line(campaign_, plan_of(campaign_, run))));
  }

  const Campaign& campaign_;
  const Folder& folder_;
  const std::vector<std::uint64_t>& runs_;
  std::map<std::uint64_t, int>& deaths_;
  SharedBoard board_;
  std::map<pid_t, unsigned> alive_;
};

}  // namespace

bool compute_all(const Campaign& campaign, const Folder& folder, Results& results,
                 const PoolOptions& options) {
  results.refresh(folder.path());
  const std::uint64_t known = results.known();
  std::map<std::uint64_t, int> deaths;
  bool may_go_on = true;
  // a second round takes what workers had claimed when they were killed
  while (may_go_on && !results.is_complete()) {
    const std::vector<std::uint64_t> runs = results.missing();
    const std::uint64_t before = results.known() - known;
    Workers workers(campaign, folder, runs, deaths);
    const auto count =
        std::min<std::size_t>({options.workers, kMostWorkers, runs.size() / kRunsPerClaim + 1});
    for (unsigned worker = 0; worker < count; ++worker) workers.start(worker);
    while (workers.is_any_alive()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      workers.reap();
      if (may_go_on && !options.may_go_on(before + workers.done(), results.needed() - known)) {
        may_go_on = false;
        workers.end();
      }
    }
    results.refresh(folder.path());
  }
  return may_go_on;
}

bool compute_share(const Campaign& campaign, const Folder& folder, Results& results,
                   std::uint64_t share, std::uint64_t shares,
                   const std::function<bool(std::uint64_t done, std::uint64_t of)>& may_go_on) {
  ResultLog log(folder.path() / fmt::format("share-{}-of-{}.log", share, shares), campaign);
  results.refresh(folder.path());
  const std::vector<std::uint64_t> runs = results.missing(share, shares);
  std::uint64_t done = 0;
  for (const std::uint64_t run : runs) {
    if (!may_go_on(done++, runs.size())) return false;
    if (compute_one(campaign, run, log)) break;
  }
  results.refresh(folder.path());
  return true;
}

}  // namespace palpate::campaign
