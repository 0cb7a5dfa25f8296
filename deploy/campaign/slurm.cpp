// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/slurm.h"

#include <fcntl.h>
#include <spawn.h>
#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/output_file.h"
#include "deploy/campaign/shell_word.h"
#include "deploy/campaign/shown_text.h"

namespace palpate::campaign {
namespace {

namespace fs = std::filesystem;

constexpr auto kPollInterval = std::chrono::milliseconds(500);
constexpr int kQueuePolls = 4;     // the queue is asked every so many polls
constexpr int kFruitlessJobs = 3;  // that ended without a new result
constexpr int kTaskAttempts = 5;   // of a task whose command a signal kills
constexpr std::size_t kShownBytes = 2000;
constexpr int kIsNotThere = 127;
constexpr std::size_t kMostDigits = 10;  // of a job's number, 32 bits
constexpr std::uintmax_t kMostJobBytes = 100;
constexpr std::uint64_t kMostShares = 1'000'000;

struct Output {
  int status = -1;
  std::string out;
  std::string err;
};

/// A file in memory that a program writes.
class Capture {
 public:
  Capture() : descriptor_(::memfd_create("palpate", MFD_CLOEXEC)) {
    if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), "memfd_create");
  }
  ~Capture() { ::close(descriptor_); }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::string text() const {
    std::string text;
    char block[4096];
    for (off_t at = 0;;) {
      const ssize_t size = ::pread(descriptor_, block, sizeof block, at);
      if (size <= 0) return text;
      text.append(block, static_cast<std::size_t>(size));
      at += size;
    }
  }

 private:
  int descriptor_;
};

/// A program with its arguments, without a shell. Status 127: it is not there.
Output run(std::vector<std::string> words) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const Capture out;
  const Capture err;
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, out.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, err.descriptor(), STDERR_FILENO);
  pid_t pid = 0;
  const int error =
      ::posix_spawnp(&pid, words.front().c_str(), &files, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) return {kIsNotThere, {}, std::generic_category().message(error)};
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0) {
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), words.front());
  }
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out.text(), err.text()};
}

/// A job of another name or user is gone: its number may come from the folder of somebody else, or
/// Slurm has given it out again.
enum class JobState : std::uint8_t { kThere, kGone, kUnknown };

/// In which a job stays; in every other one it may still run, or run again.
constexpr std::array<std::string_view, 10> kEnded = {
    "BOOT_FAIL", "CANCELLED",     "COMPLETED", "DEADLINE", "FAILED",
    "NODE_FAIL", "OUT_OF_MEMORY", "PREEMPTED", "REVOKED",  "TIMEOUT"};

std::string job_name(const Campaign& campaign) { return "palpate-" + campaign.name; }

/// Unknown while slurmctld does not answer: it may be starting again.
JobState state_of(const std::string& job, const Campaign& campaign) {
  const Output queue =
      run({"squeue", "--noheader", "--states=all", "--format=%T %U %j", "--jobs=" + job});
  if (queue.err.find("Invalid job id") != std::string::npos) return JobState::kGone;
  if (queue.status != 0) return JobState::kUnknown;
  const std::string owner = fmt::format(" {} {}", ::geteuid(), job_name(campaign));
  std::istringstream tasks(queue.out);
  for (std::string task; std::getline(tasks, task);) {
    const std::size_t end = std::min(task.find(' '), task.size());
    const bool has_ended = std::find(kEnded.begin(), kEnded.end(),
                                     std::string_view(task).substr(0, end)) != kEnded.end();
    if (!has_ended && task.substr(end) == owner) return JobState::kThere;
  }
  return JobState::kGone;
}

/// The job of an earlier call, and the division that its tasks use: it stays that of the folder.
struct Job {
  std::string id;
  std::uint64_t shares = 0;
};

class JobFile {
 public:
  explicit JobFile(const Folder& folder) : file_(folder.path() / "slurm.job") {}
  [[nodiscard]] Job read() const {
    if (!fs::exists(file_)) return {};
    const FileContent content = read_text_file(file_, kMostJobBytes);
    std::istringstream in(content.bytes);
    Job job;
    const bool is_read = static_cast<bool>(in >> job.id >> job.shares);
    const bool is_number = !job.id.empty() && job.id.size() <= kMostDigits &&
                           job.id.find_first_not_of("0123456789") == std::string::npos;
    if (!is_read || !is_number || job.shares < 1 || job.shares > kMostShares) {
      throw SetupError(file_.string() +
                       ": must be the number of a Slurm job and that of its tasks, as this command "
                       "writes it; remove the file to submit a new job");
    }
    return job;
  }
  void write(const Job& job) const {
    write_file("job", file_.string(), fmt::format("{} {}\n", job.id, job.shares), true);
  }

 private:
  fs::path file_;
};

/// "0,3,7": the shares that lack a result.
std::string array_of(const Results& results, std::uint64_t shares) {
  std::vector<bool> is_open(shares);
  for (const std::uint64_t one : results.missing()) is_open[one % shares] = true;
  std::string array;
  for (std::uint64_t share = 0; share < shares; ++share) {
    if (is_open[share]) array += fmt::format("{}{}", array.empty() ? "" : ",", share);
  }
  return array;
}

std::string submit(const Campaign& campaign, const Folder& folder, const Results& results,
                   std::uint64_t shares, const SlurmOptions& options) {
  const fs::path home = fs::absolute(folder.path());
  const std::string script_file = (home / "sweep.sbatch").string();
  std::string script =
      fmt::format("#!/bin/sh\nfor attempt in $(seq {}); do\n  {} sweep", kTaskAttempts,
                  shell_word(fs::read_symlink("/proc/self/exe").string()));
  for (const std::string& argument : options.arguments)
    script += fmt::format(" {}", shell_word(argument));
  script += fmt::format(
      " --quiet --folder {} --share \"$SLURM_ARRAY_TASK_ID/{}\"\n"
      "  status=$?\n  [ $status -gt 128 ] || exit $status\ndone\nexit $status\n",
      shell_word(home.string()), shares);
  write_file("job script", script_file, script, true);

  // relative to --chdir, which takes any name of a folder as it is
  std::vector<std::string> command{"sbatch",
                                   "--parsable",
                                   "--array=" + array_of(results, shares),
                                   "--ntasks=1",
                                   "--cpus-per-task=1",
                                   "--requeue",
                                   "--open-mode=append",
                                   "--chdir=" + home.string(),
                                   "--output=slurm-%a.out"};
  command.insert(command.end(), options.sbatch.begin(), options.sbatch.end());
  command.push_back("--job-name=" + job_name(campaign));  // last: by it the job is known again
  command.push_back(script_file);
  const Output answer = run(command);
  // "12", or "12;cluster"; warnings are on standard error
  std::string id = answer.out.substr(0, answer.out.find_first_not_of("0123456789"));
  if (answer.status != 0 || id.empty()) {
    throw SetupError("sbatch: " + shown_text(answer.err.substr(0, kShownBytes)) +
                     (answer.status == kIsNotThere
                          ? "; install Slurm's client (Debian: slurm-client), or leave --slurm out"
                          : ""));
  }
  if (!answer.err.empty()) options.say("sbatch: " + shown_text(answer.err.substr(0, kShownBytes)));
  return id;
}

/// The last bytes of a file, however large it is; empty if it is or cannot be read.
std::string end_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::int64_t>(in.tellg());
  if (size <= 0) return {};
  std::string end(std::min(static_cast<std::size_t>(size), kShownBytes), '\0');
  in.seekg(size - static_cast<std::int64_t>(end.size()));
  in.read(end.data(), static_cast<std::streamsize>(end.size()));
  end.resize(static_cast<std::size_t>(in.gcount()));
  return end;
}

/// The ends of what the tasks printed.
std::string printed_by_tasks(const Folder& folder) {
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    if (entry.path().extension() != ".out") continue;
    const std::string end = end_of(entry.path());
    if (!end.empty()) return fmt::format("\n{}: {}", entry.path().string(), shown_text(end));
  }
  return {};
}

}  // namespace

bool compute_with_slurm(const Campaign& campaign, const Folder& folder, Results& results,
                        const SlurmOptions& options) {
  results.refresh(folder.path());
  const std::uint64_t known = results.known();
  const JobFile file(folder);
  Job job = file.read();
  if (job.shares == 0) job.shares = options.shares;
  std::uint64_t known_at_submission = known;
  int fruitless = 0;
  bool is_unknown = false;
  if (!job.id.empty()) options.say(fmt::format("follows Slurm job {} of an earlier call", job.id));
  for (int poll = 0; !results.is_complete(); ++poll) {
    if (!job.id.empty() && poll % kQueuePolls == 0) {
      const JobState state = state_of(job.id, campaign);
      if (state == JobState::kUnknown && !is_unknown) options.say("Slurm does not answer; waits");
      is_unknown = state == JobState::kUnknown;
      if (state == JobState::kGone) {
        results.refresh(folder.path());
        if (results.is_complete()) break;
        options.say(fmt::format("Slurm job {} has ended with {} runs left", job.id,
                                results.needed() - results.known()));
        fruitless = results.known() > known_at_submission ? 0 : fruitless + 1;
        if (fruitless == kFruitlessJobs) {
          throw std::runtime_error(fmt::format("{} jobs of Slurm have ended without a result{}",
                                               kFruitlessJobs, printed_by_tasks(folder)));
        }
        job.id.clear();
      }
    }
    if (job.id.empty()) {
      known_at_submission = results.known();
      job.id = submit(campaign, folder, results, job.shares, options);
      file.write(job);
      options.say(fmt::format("submitted Slurm job {} with tasks {} of {}", job.id,
                              array_of(results, job.shares), job.shares));
    }
    if (!options.may_go_on(results.known() - known, results.needed() - known)) {
      options.say(
          fmt::format("Slurm job {} goes on; the same command collects it, scancel {} "
                      "ends it",
                      job.id, job.id));
      return false;
    }
    std::this_thread::sleep_for(kPollInterval);
    results.refresh(folder.path());
  }
  // tasks that compute what stop_at_violation does not need
  if (!job.id.empty() && results.needed() < campaign.run_count() &&
      state_of(job.id, campaign) == JobState::kThere) {
    static_cast<void>(run({"scancel", job.id}));
  }
  return true;
}

}  // namespace palpate::campaign
