// SPDX-License-Identifier: Apache-2.0
// `palpate sweep --slurm` with a Slurm of one node, started and stopped by the test: the table is
// that of a local run, also if a task and slurmctld are killed in the middle and the node is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/loopback/campaign/campaign_support.h"
#include "tests/support/port.h"
#include "tests/support/text.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using test::kSmallRuns;
using test::logged_lines;
using test::Program;
using test::run_program;
using test::text_of;
using testing::HasSubstr;

std::string own_host() {
  char name[256] = {};
  ::gethostname(name, sizeof name - 1);
  const std::string host(name);
  return host.substr(0, host.find('.'));
}

pid_t parent_of(pid_t process) {
  std::ifstream in("/proc/" + std::to_string(process) + "/stat");
  std::string field;
  pid_t parent = 0;
  in >> field >> field >> field >> parent;  // number (name) state parent
  return parent;
}

std::pair<std::string, std::string> free_ports() {
  const test::HeldPort first;
  const test::HeldPort second;
  const auto number = [](const test::HeldPort& port) {
    return port.endpoint().substr(port.endpoint().rfind(':') + 1);
  };
  return {number(first), number(second)};
}

/// munged, slurmctld and slurmd in the foreground, with everything in one folder.
class Slurm {
 public:
  /// Why Slurm cannot run here; empty: it can.
  static std::string obstacle() {
    for (const char* program : {"/usr/sbin/munged", "/usr/sbin/slurmctld", "/usr/sbin/slurmd",
                                "/usr/bin/sbatch", "/usr/bin/squeue", "/usr/bin/scontrol"}) {
      if (!fs::exists(program)) return std::string(program) + " is not installed (slurm-wlm)";
    }
    if (::geteuid() != 0) return "slurmd needs root";
    return {};
  }

  explicit Slurm(const fs::path& folder) : folder_(folder) {
    std::random_device random;
    std::string key;
    for (int i = 0; i < 1024; ++i) key += static_cast<char>(random());
    std::ofstream(folder_ / "munge.key", std::ios::binary) << key;
    fs::permissions(folder_ / "munge.key", fs::perms::owner_read | fs::perms::owner_write);
    fs::create_directories(folder_ / "state");
    fs::create_directories(folder_ / "spool");
    const std::string host = own_host();
    const auto [first_port, second_port] = free_ports();
    std::ofstream(folder_ / "slurm.conf")
        << "ClusterName=t\nSlurmctldHost=" << host << "(127.0.0.1)\nSlurmUser=root\n"
        << "AuthType=auth/munge\nCredType=cred/munge\nAuthInfo=socket=" << file("munge.socket")
        << ",cred_expire=5"  // how long a requeued task waits
        << "\nStateSaveLocation=" << file("state") << "\nSlurmdSpoolDir=" << file("spool")
        << "\nSlurmctldPidFile=" << file("ctld.pid") << "\nSlurmdPidFile=" << file("d.pid")
        << "\nSlurmctldPort=" << first_port << "\nSlurmdPort=" << second_port
        << "\nProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSelectType=select/cons_tres\n"
        << "SelectTypeParameters=CR_Core\n"
        << "ReturnToService=2\nMpiDefault=none\nSwitchType=switch/none\n"
        << "SlurmctldTimeout=30\nSlurmdTimeout=30\nKillWait=1\n"
        << "NodeName=" << host << " NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN\n"
        << "PartitionName=p Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n";
    ::setenv("SLURM_CONF", file("slurm.conf").c_str(), 1);
    munged_.emplace("/usr/sbin/munged",
                    std::vector<std::string>{
                        "--foreground", "--force", "--key-file=" + file("munge.key"),
                        "--socket=" + file("munge.socket"), "--pid-file=" + file("munged.pid"),
                        "--log-file=" + file("munged.log"), "--seed-file=" + file("munged.seed")});
    start_controller();
    start_node();
  }

  [[nodiscard]] bool is_ready() const {
    return test::await([] {
      return run_program("/usr/bin/sinfo", {"--noheader", "--format=%T"}).out.find("idle") !=
             std::string::npos;
    });
  }
  void kill_controller() {
    controller_->send_signal(SIGKILL);
    controller_->wait();
  }
  /// The node with all that runs on it, as its controller finds out.
  void lose_node(const std::vector<pid_t>& tasks) {
    node_->send_signal(SIGKILL);
    node_->wait();
    for (const pid_t task : tasks) {
      const pid_t script = parent_of(task);
      ::kill(parent_of(script), SIGKILL);  // slurmstepd
      ::kill(script, SIGKILL);
      ::kill(task, SIGKILL);
    }
    EXPECT_TRUE(test::await([] {
      return run_program("/usr/bin/scontrol",
                         {"update", "NodeName=" + own_host(), "State=DOWN", "Reason=lost"})
                 .status == 0;
    }));
  }
  void start_controller() {
    controller_.emplace("/usr/sbin/slurmctld",
                        std::vector<std::string>{"-D", "-f", file("slurm.conf")});
  }
  void start_node() {
    node_.emplace("/usr/sbin/slurmd", std::vector<std::string>{"-D", "-f", file("slurm.conf")});
  }
  [[nodiscard]] std::string messages() const {
    return controller_->err() + node_->err() + munged_->err() + text_of(folder_ / "munged.log");
  }

 private:
  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_ / name).string();
  }

  fs::path folder_;
  std::optional<Program> munged_;
  std::optional<Program> controller_;
  std::optional<Program> node_;
};

/// The tasks of the job: processes with the folder of the sweep and --share in their command line.
std::vector<pid_t> tasks_of(const std::string& folder) {
  std::vector<pid_t> tasks;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::string command;
    std::ifstream in(entry.path() / "cmdline");
    std::getline(in, command, '\n');  // a process may end meanwhile: nothing is read
    if (command.find(folder) != std::string::npos && command.find("--share") != std::string::npos &&
        command.find("sweep.sbatch") == std::string::npos) {
      tasks.push_back(std::stoi(name));
    }
  }
  return tasks;
}

using SlurmSweep = test::CampaignFolder;

TEST_F(SlurmSweep, GivesTheTableOfALocalRunWhateverIsKilledInTheMiddle) {
  if (const std::string obstacle = Slurm::obstacle(); !obstacle.empty()) {
    GTEST_SKIP() << obstacle;
  }
  const test::TempFolder home;
  Slurm slurm(home.path());
  ASSERT_TRUE(slurm.is_ready()) << slurm.messages();

  Program collector("palpate", arguments_of("cluster", {"--slurm", "--workers", "2"}));
  std::vector<pid_t> tasks;
  ASSERT_TRUE(test::await([&] {
    tasks = tasks_of(path("cluster"));
    for (const pid_t task : tasks) ::kill(task, SIGSTOP);
    return tasks.size() == 2;
  })) << collector.err()
      << slurm.messages();
  ::kill(tasks[0], SIGCONT);
  const int moment = 1 + static_cast<int>(std::random_device{}() % (kSmallRuns / 2 - 10));
  SCOPED_TRACE("killed after " + std::to_string(moment) + " runs");
  ASSERT_TRUE(test::await([&] { return logged_lines(path("cluster")) >= moment; }));
  ::kill(tasks[0], SIGKILL);
  const int at_kill = logged_lines(path("cluster"));
  ASSERT_TRUE(test::await([&] { return logged_lines(path("cluster")) > at_kill; }))
      << "the task has not begun again: " << slurm.messages();
  slurm.lose_node(tasks_of(path("cluster")));
  EXPECT_TRUE(test::await([] {  // requeued
    return run_program("/usr/bin/scontrol", {"show", "jobs"}).out.find("Restarts=1") !=
           std::string::npos;
  }));
  slurm.start_node();
  slurm.kill_controller();
  slurm.start_controller();

  EXPECT_EQ(collector.wait(std::chrono::seconds(100)), 0) << collector.err() << slurm.messages();
  EXPECT_THAT(collector.err(), HasSubstr("submitted Slurm job"));
  EXPECT_EQ(text_of(path("cluster.csv")), undisturbed());
}

/// Programs of this folder stand in for those of Slurm: sbatch warns on standard error, notes its
/// arguments and computes the only task; squeue notes its arguments and prints one line of the file
/// queue for each call, at last its last one; scancel notes its arguments.
class StandIns {
 public:
  explicit StandIns(const test::TempFolder& folder)
      : path_(std::getenv("PATH") != nullptr ? std::getenv("PATH") : "") {
    write(folder, "sbatch",
          "#!/bin/sh\ncd \"$(dirname \"$0\")\"\nprintf '%s\\0' \"$@\" > sbatch.words\n"
          "for script; do :; done\necho 'sbatch: warning: 12 nodes are down' >&2\n"
          "SLURM_ARRAY_TASK_ID=0 sh \"$script\" || exit\necho '7;cluster'\n");
    write(folder, "squeue",
          "#!/bin/sh\ncd \"$(dirname \"$0\")\"\necho \"$@\" >> squeue.words\n"
          "[ ! -f queue ] || head -n $(wc -l < squeue.words) queue | tail -n 1\n");
    write(folder, "scancel", "#!/bin/sh\necho \"$@\" >> \"$(dirname \"$0\")/scancel.words\"\n");
    ::setenv("PATH", (folder.path().string() + ":" + path_).c_str(), 1);
  }
  ~StandIns() { ::setenv("PATH", path_.c_str(), 1); }
  StandIns(const StandIns&) = delete;
  StandIns& operator=(const StandIns&) = delete;

 private:
  static void write(const test::TempFolder& folder, const std::string& name,
                    const std::string& text) {
    fs::permissions(folder.write(name, text), fs::perms::owner_all);
  }
  std::string path_;
};

TEST_F(SlurmSweep, TakesAnyNameOfAFolderAndAWarningOfSbatch) {
  const test::TempFolder programs;
  const StandIns stand_ins(programs);
  const std::string folder = "a b%j\n'c;touch d";
  const auto outcome = run_program("palpate", arguments_of(folder, {"--slurm", "--workers", "1"}));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("submitted Slurm job 7 "));
  EXPECT_THAT(outcome.err, HasSubstr("12 nodes are down"));
  EXPECT_EQ(text_of(path(folder + ".csv")), undisturbed());
  const std::string words = text_of(programs.path() / "sbatch.words");
  EXPECT_THAT(words, HasSubstr("--chdir=" + path(folder)));
  EXPECT_THAT(words, HasSubstr("--job-name=palpate-small"));
}

// As found in the folder of somebody else.
TEST_F(SlurmSweep, RefusesAJobThatIsNoNumber) {
  const test::TempFolder programs;
  const StandIns stand_ins(programs);
  const std::string mark = path("executed");
  ASSERT_EQ(run_program("palpate", arguments_of("theirs", {"--workers", "1"})).status, 0);
  for (const auto& entry : fs::directory_iterator(path("theirs"))) {
    if (entry.path().extension() == ".log") fs::remove(entry.path());
  }
  for (const std::string& job :
       {";touch${IFS}" + mark + " 2", std::string("7 0"), std::string("7"), std::string("-7 1"),
        std::string("77777777777777 1"), std::string("7 99999999999")}) {
    std::ofstream(path("theirs") + "/slurm.job") << job << '\n';
    const auto outcome = run_program(
        "palpate", arguments_of("theirs", {"--slurm", "--workers", "1", "--overwrite"}));
    EXPECT_EQ(outcome.status, 2) << job;
    EXPECT_THAT(outcome.err, HasSubstr("slurm.job")) << job;
    EXPECT_FALSE(fs::exists(mark)) << job;
    EXPECT_FALSE(fs::exists(programs.path() / "squeue.words")) << job;
  }
}

TEST_F(SlurmSweep, CancelsNoJobOfAnotherNameOrUser) {
  const test::TempFolder programs;
  const StandIns stand_ins(programs);
  campaign_ = files_.write(
      "stop.txtpb", test::replaced(test::kSmallCampaign, "at_least: -1\n", "at_least: -1e-6\n") +
                        "stop_at_violation: true\n");
  ASSERT_EQ(run_program("palpate", arguments_of("stop", {"--workers", "1"})).status, 1);
  const std::string user = std::to_string(::geteuid());
  const auto is_cancelled = [&](const std::string& queue) {
    programs.write("queue", queue + "\n");
    std::ofstream(path("stop") + "/slurm.job") << "777 2\n";
    const auto outcome =
        run_program("palpate", arguments_of("stop", {"--slurm", "--workers", "1", "--overwrite"}));
    EXPECT_EQ(outcome.status, 1) << outcome.err;
    return fs::exists(programs.path() / "scancel.words");
  };
  EXPECT_FALSE(is_cancelled("RUNNING " + user + " simulation"));
  EXPECT_FALSE(is_cancelled("RUNNING " + user + "0 palpate-small"));
  EXPECT_FALSE(is_cancelled("RUNNING " + user + " my palpate-small"));
  EXPECT_FALSE(is_cancelled("COMPLETED " + user + " palpate-small"));
  EXPECT_TRUE(is_cancelled("RUNNING " + user + " palpate-small"));
  EXPECT_EQ(text_of(programs.path() / "scancel.words"), "777\n");
}

TEST_F(SlurmSweep, WaitsForAJobInEveryStateInWhichItHasNotEnded) {
  const test::TempFolder programs;
  const StandIns stand_ins(programs);
  const std::string own = " " + std::to_string(::geteuid()) + " palpate-small\n";
  std::string queue;
  int waits = 0;
  for (const char* state : {"POWER_UP_NODE", "STOPPED", "REQUEUE_HOLD", "RESV_DEL_HOLD",
                            "SPECIAL_EXIT", "REQUEUE_FED"}) {
    queue += state + own;
    ++waits;
  }
  programs.write("queue", queue + "NODE_FAIL" + own);
  fs::create_directory(path("held"));
  std::ofstream(path("held") + "/slurm.job") << "5 1\n";

  const auto outcome = run_program("palpate", arguments_of("held", {"--slurm", "--workers", "1"}));

  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("Slurm job 5 has ended with 160 runs left"));
  const std::string words = text_of(programs.path() / "squeue.words");
  EXPECT_GT(std::count(words.begin(), words.end(), '\n'), waits);
}

TEST_F(SlurmSweep, ShowsWhatTasksPrintedWithoutItsControlCharacters) {
  const test::TempFolder programs;
  const StandIns stand_ins(programs);
  fs::permissions(programs.write("sbatch", "#!/bin/sh\necho 7\n"), fs::perms::owner_all);
  fs::create_directory(path("theirs"));
  const std::string printed = path("theirs") + "/slurm-0.out";
  std::ofstream(printed) << "begin";
  fs::resize_file(printed, std::uintmax_t{40} << 30U);  // sparse
  std::ofstream(printed, std::ios::app)
      << "\n\x1b]0;title\x07 \xc2\x9b;2J \x9b;2J \x7f k ≥ 2, caf\xc3\n\tend\n";

  const auto outcome =
      run_program("palpate", arguments_of("theirs", {"--slurm", "--workers", "1"}));

  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("\n?]0;title? ?;2J ?;2J ? k ≥ 2, caf?\n\tend\n"));
  EXPECT_EQ(outcome.err.find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace palpate
