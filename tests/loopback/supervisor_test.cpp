// SPDX-License-Identifier: Apache-2.0
// The supervisor with real processes: fake_node under the names of the nodes. Each process reports
// its start and its signals through a named pipe. The pipe reaches its end when the last process is
// gone.
#include "deploy/launch/supervisor.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <boost/asio/post.hpp>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/process/realtime.h"
#include "common/process/tcp_port.h"
#include "common/session/session_file.h"
#include "deploy/launch/launch.h"
#include "deploy/launch/run_folder.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

const auto kDeadline = test::patience(seconds(20));

class Launch : public testing::Test {
 protected:
  Launch() {
    for (const char* name : {"physics_node", "mofc_node", "device_node", "viewer_node"}) {
      fs::create_symlink(fs::path(test::binary_dir()) / "fake_node", folder_ / name);
    }
    files_.write("session.txtpb", "name: \"" + session_name_ + "\"\n");
    EXPECT_EQ(mkfifo((folder_ / "events").c_str(), 0600), 0);
    events_ = open((folder_ / "events").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  }
  ~Launch() override {
    if (launcher_ > 0) {
      kill(launcher_, SIGKILL);
      waitpid(launcher_, nullptr, 0);
    }
    if (has_one_processor_) sched_setaffinity(0, sizeof(cpu_set_t), &allowed_);
    close(events_);
  }

  LaunchOptions options() const {
    return {.session_file = folder_ / "session.txtpb",
            .program_folder = folder_,
            .timing = {.first_back_off = milliseconds(1)}};
  }

  /// Starts a launcher in a process group of its own. It reports its result through the pipe; its
  /// log goes to the file "log".
  void start_launcher(const LaunchOptions& options) {
    launcher_ = fork();
    ASSERT_GE(launcher_, 0);
    if (launcher_ > 0) return;
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // nothing is left if the test is killed
    const int log = open((folder_ / "log").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    dup2(log, STDERR_FILENO);
    if (has_one_processor_) sched_setaffinity(0, sizeof(cpu_set_t), &saturated_);
    std::ostringstream line;
    int status = 9;
    try {
      const LaunchResult result = launch(options);
      line << "launcher end=" << static_cast<int>(result.end);
      for (const auto& node : result.restarts) line << " " << node.name << "=" << node.count;
      line << "\n";
      status = result.exit_status();
    } catch (const SetupError& e) {
      line << "launcher " << e.what() << "\n";
    }
    std::ofstream(folder_ / "events") << line.str() << std::flush;
    _exit(status);
  }

  /// The log of the launcher, once it contains the text; empty when the deadline has passed.
  std::string log_with(const std::string& text) const {
    while (left() > 0) {
      std::ifstream file(folder_ / "log");
      std::string log(std::istreambuf_iterator<char>(file), {});
      if (log.find(text) != std::string::npos) return log;
      std::this_thread::sleep_for(milliseconds(5));
    }
    return "";
  }

  int launcher_status() {
    int status = 0;
    waitpid(launcher_, &status, 0);
    launcher_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// The next line of the pipe; empty when the deadline has passed.
  std::string next_event() {
    for (;;) {
      if (const auto end = unread_.find('\n'); end != std::string::npos) {
        std::string line = unread_.substr(0, end);
        unread_.erase(0, end + 1);
        return line;
      }
      pollfd pipe{.fd = events_, .events = POLLIN, .revents = 0};
      if (poll(&pipe, 1, left()) <= 0) return "";
      char text[4096];
      const ssize_t n = read(events_, text, sizeof(text));
      if (n > 0) {
        unread_.append(text, static_cast<std::size_t>(n));
      } else if (left() == 0) {
        return "";
      }
    }
  }

  /// Process ids by program, once `count` nodes have started; throws if they do not.
  std::map<std::string, pid_t> started_nodes(int count) {
    std::map<std::string, pid_t> nodes;
    for (int i = 0; i < count; ++i) {
      const std::string event = next_event();
      std::istringstream words(event);
      std::string name;
      std::string verb;
      pid_t pid = 0;
      words >> name >> verb >> pid;
      // kill(0) would end this test's whole process group
      if (verb != "started" || pid <= 0) throw std::runtime_error("not started: " + event);
      nodes[name] = pid;
    }
    return nodes;
  }

  /// True when no node is left: each holds the pipe open as long as it runs.
  bool all_nodes_end() {
    for (;;) {
      pollfd pipe{.fd = events_, .events = 0, .revents = 0};
      if (poll(&pipe, 1, left()) <= 0) return false;
      if ((pipe.revents & POLLHUP) != 0) return true;
    }
  }

  /// Milliseconds until the deadline of this test, for poll().
  int left() const {
    const auto left = std::chrono::ceil<milliseconds>(deadline_ - steady_clock::now());
    return static_cast<int>(std::max(left, milliseconds(0)).count());
  }

  /// Sides with ticks that leave no processor to anybody, on one processor.
  LaunchOptions saturating_sides(int count) {
    has_one_processor_ = true;
    sched_getaffinity(0, sizeof(cpu_set_t), &allowed_);
    std::size_t first = 0;
    while (!CPU_ISSET(first, &allowed_)) ++first;
    CPU_ZERO(&saturated_);
    CPU_SET(first, &saturated_);
    cpu_set_t others = allowed_;  // for this test
    CPU_CLR(first, &others);
    sched_setaffinity(0, sizeof(cpu_set_t), &others);  // refused if there are none
    std::string session = "name: \"" + session_name_ + "\"\n";
    for (int i = 0; i < count; ++i) session += "side { name: \"s" + std::to_string(i) + "\" }\n";
    files_.write("session.txtpb", session);
    for (const char* name : {"physics_node", "mofc_node", "device_node"}) let(name, "saturates");
    LaunchOptions options = this->options();
    options.timing.stop_grace = std::chrono::hours(1);  // all end in order
    options.overrides = {"realtime.priority=5"};
    return options;
  }
  /// Lets all of them begin, once they are ready.
  void saturate(int count) {
    std::vector<pid_t> nodes;
    for (int ready = 0; ready < count;) {
      const std::string event = next_event();
      if (event.empty()) throw std::runtime_error("not all are ready");
      if (event.ends_with(" ready")) {
        ++ready;
        continue;
      }
      std::istringstream words(event);
      std::string name;
      std::string verb;
      words >> name >> verb >> nodes.emplace_back();
    }
    for (const pid_t node : nodes) {
      if (node > 0) kill(node, SIGUSR1);
    }
  }
  /// The names of the nodes that were stopped, in order, and then what the launcher reports.
  std::vector<std::string> stopped(int count) {
    std::vector<std::string> events;
    for (int i = 0; i < count; ++i) {
      const std::string event = next_event();
      if (events.empty() || events.back() != event) events.push_back(event);
    }
    events.push_back(next_event().substr(0, std::string("launcher end=0").size()));
    return events;
  }

  void let(const std::string& node, const std::string& what) const {
    files_.write(node + ".does", what);
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string session_name_ = "supervisor_test";
  fs::path folder_ = files_.path();  // of the programs and their pipe
  steady_clock::time_point deadline_ = steady_clock::now() + kDeadline;
  int events_ = -1;
  std::string unread_;
  pid_t launcher_ = 0;
  bool has_one_processor_ = false;  // the launcher and its nodes
  cpu_set_t saturated_{};
  cpu_set_t allowed_{};
};

TEST_F(Launch, CtrlCReachesOnlyTheLauncherWhichStopsAllInOrder) {
  LaunchOptions options = this->options();
  options.nodes.insert("viewer");
  start_launcher(options);
  started_nodes(4);

  kill(-launcher_, SIGINT);  // as a terminal does: to the whole process group

  EXPECT_EQ(next_event(), "device_node signal 15");
  EXPECT_EQ(next_event(), "mofc_node signal 15");
  EXPECT_EQ(next_event(), "physics_node signal 15");
  EXPECT_EQ(next_event(), "viewer_node signal 15");
  EXPECT_EQ(next_event(), "launcher end=1 physics=0 mofc=0 device=0 viewer=0");
  EXPECT_EQ(launcher_status(), 0);
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, EveryNodeGetsTheSessionAndItsOverrides) {
  LaunchOptions options = this->options();
  options.overrides = {"physics.rate_hz=500", "seed=3"};
  options.is_realtime = false;
  start_launcher(options);

  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(next_event(), HasSubstr(" --session " + options.session_file.string() +
                                        " --set physics.rate_hz=500 --set seed=3 --no-realtime"));
  }
}

// So nobody else can take the port of the page once it is announced.
TEST_F(Launch, TheViewerAloneInheritsTheSocketOfThePage) {
  LaunchOptions options = this->options();
  options.nodes.insert("viewer");
  std::optional<ListeningPort> page = ListeningPort::open(0);
  ASSERT_TRUE(page);
  const std::string descriptor = std::to_string(page->descriptor());
  options.on_page = [&] { return page->descriptor(); };
  start_launcher(options);

  for (int i = 0; i < 4; ++i) {
    const std::string event = next_event();
    const bool is_viewer = event.starts_with("viewer_node");
    std::istringstream words(event);
    std::string name;
    std::string verb;
    std::string pid;
    words >> name >> verb >> pid;
    std::error_code error;
    const std::string held = fs::read_symlink(fs::path("/proc") / pid / "fd" / descriptor, error);
    EXPECT_EQ(held == fs::read_symlink("/proc/self/fd/" + descriptor), is_viewer) << event;
    EXPECT_EQ(event.find("--listen-descriptor " + descriptor) != std::string::npos, is_viewer);
  }
}

TEST_F(Launch, ANodeThatDiesIsStartedAgain) {
  start_launcher(options());
  auto nodes = started_nodes(3);

  kill(nodes.at("physics_node"), SIGKILL);

  EXPECT_THAT(next_event(), StartsWith("physics_node started "));
  kill(launcher_, SIGTERM);
  EXPECT_EQ(next_event(), "device_node signal 15");
  EXPECT_EQ(next_event(), "mofc_node signal 15");
  EXPECT_EQ(next_event(), "physics_node signal 15");
  EXPECT_EQ(next_event(), "launcher end=1 physics=1 mofc=0 device=0");
}

// It would hold the endpoints of the node that is started again.
TEST_F(Launch, WhatADeadNodeHasStartedDiesWithIt) {
  let("physics_node", "leaves_a_process");
  start_launcher(options());
  auto nodes = started_nodes(3);
  let("physics_node", "nothing");

  kill(nodes.at("physics_node"), SIGKILL);
  EXPECT_THAT(next_event(), StartsWith("physics_node started "));
  kill(launcher_, SIGTERM);

  EXPECT_TRUE(all_nodes_end());
}

// Two ticks at SCHED_FIFO may leave no processor to ordinary threads.
TEST_F(Launch, TheSupervisorRunsAheadOfTheTicks) {
  constexpr int kPriority = 5;
  if (!may_use_fifo(kPriority + 1)) GTEST_SKIP() << "SCHED_FIFO is not permitted";
  LaunchOptions options = this->options();
  options.overrides = {"realtime.priority=" + std::to_string(kPriority)};
  start_launcher(options);
  const auto nodes = started_nodes(3);

  int ahead = 0;
  for (const auto& thread :
       fs::directory_iterator("/proc/" + std::to_string(launcher_) + "/task")) {
    const pid_t id = std::stoi(thread.path().filename());
    sched_param parameters{};
    if ((sched_getscheduler(id) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO &&
        sched_getparam(id, &parameters) == 0 && parameters.sched_priority == kPriority + 1) {
      ++ahead;
    }
  }
  EXPECT_EQ(ahead, 1);
  for (const auto& [name, pid] : nodes) EXPECT_EQ(sched_getscheduler(pid), SCHED_OTHER) << name;
}

// 8 sides on one processor, 17 nodes in all, each of which uses all of it with SCHED_FIFO.
constexpr int kSides = 8;
constexpr int kNodes = 2 * kSides + 1;

TEST_F(Launch, ThatSaturatesItsProcessorStopsOnASignal) {
  if (!may_use_fifo(6)) GTEST_SKIP() << "SCHED_FIFO is not permitted";
  start_launcher(saturating_sides(kSides));
  saturate(kNodes);

  kill(launcher_, SIGTERM);

  EXPECT_THAT(stopped(kNodes), testing::ElementsAre("device_node signal 15", "mofc_node signal 15",
                                                    "physics_node signal 15", "launcher end=1"));
  EXPECT_EQ(launcher_status(), 0);
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, ThatSaturatesItsProcessorEndsWhenItsTimeIsUp) {
  if (!may_use_fifo(6)) GTEST_SKIP() << "SCHED_FIFO is not permitted";
  LaunchOptions options = saturating_sides(kSides);
  options.seconds = std::chrono::duration<double>(test::patience(milliseconds(250))).count();
  start_launcher(options);
  saturate(kNodes);

  EXPECT_THAT(stopped(kNodes), testing::ElementsAre("device_node signal 15", "mofc_node signal 15",
                                                    "physics_node signal 15", "launcher end=0"));
  EXPECT_EQ(launcher_status(), 0);
  EXPECT_TRUE(all_nodes_end());
}

// A thread at the least real-time priority has no processor to die on while others saturate it.
TEST_F(Launch, ThatSaturatesItsProcessorStopsAlsoIfANodeCannotDie) {
  if (!may_use_fifo(6)) GTEST_SKIP() << "SCHED_FIFO is not permitted";
  LaunchOptions options = saturating_sides(2);
  options.timing.stop_grace = test::patience(milliseconds(500));
  let("device_node", "lingers");
  start_launcher(options);
  saturate(5);

  kill(launcher_, SIGTERM);

  EXPECT_THAT(stopped(5), testing::ElementsAre("device_node signal 15", "mofc_node signal 15",
                                               "physics_node signal 15", "launcher end=1"));
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, ADeviceStartedAgainRampsItsForceUpAlsoIfItsSessionHasNoRamp) {
  LaunchOptions options = this->options();
  options.overrides = {"device.start_ramp_ms=0"};
  start_launcher(options);
  auto nodes = started_nodes(3);

  kill(nodes.at("device_node"), SIGKILL);

  EXPECT_THAT(next_event(), testing::AllOf(StartsWith("device_node started "),
                                           HasSubstr("--set device.start_ramp_ms=500")));
}

TEST_F(Launch, ADeviceStartedAgainKeepsTheRampOfItsSession) {
  LaunchOptions options = this->options();
  options.overrides = {"device.start_ramp_ms=800"};
  start_launcher(options);
  auto nodes = started_nodes(3);

  kill(nodes.at("device_node"), SIGKILL);

  EXPECT_THAT(next_event(), testing::AllOf(StartsWith("device_node started "),
                                           Not(HasSubstr("device.start_ramp_ms=500"))));
}

TEST_F(Launch, ANodeThatIsRefusedStopsAllWithStatusTwo) {
  start_launcher(options());
  auto nodes = started_nodes(3);

  let("device_node", "refuses");  // at its restart
  kill(nodes.at("device_node"), SIGKILL);

  EXPECT_EQ(next_event(), "mofc_node signal 15");
  EXPECT_EQ(next_event(), "physics_node signal 15");
  EXPECT_EQ(next_event(), "launcher end=3 physics=0 mofc=0 device=1");
  EXPECT_EQ(launcher_status(), 2);
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, ANodeThatNeverCameUpMeansFailure) {
  let("physics_node", "fails");
  LaunchOptions options = this->options();
  options.timing.first_back_off = milliseconds(3'600'000);  // dead when the time is up
  options.seconds = std::chrono::duration<double>(test::patience(milliseconds(250))).count();
  start_launcher(options);
  started_nodes(2);

  EXPECT_EQ(next_event(), "device_node signal 15");
  EXPECT_EQ(next_event(), "mofc_node signal 15");
  EXPECT_EQ(next_event(), "launcher end=0 physics=0 mofc=0 device=0");
  EXPECT_EQ(launcher_status(), 1);
}

TEST_F(Launch, ANodeThatDoesNotStopIsKilledAfterTheGrace) {
  let("mofc_node", "does_not_stop");
  LaunchOptions options = this->options();
  options.timing.stop_grace = test::patience(milliseconds(125));  // the good ones end in time
  start_launcher(options);
  started_nodes(3);

  kill(launcher_, SIGTERM);

  EXPECT_EQ(next_event(), "device_node signal 15");
  EXPECT_EQ(next_event(), "mofc_node signal 15");
  EXPECT_EQ(next_event(), "physics_node signal 15");
  EXPECT_THAT(next_event(), StartsWith("launcher end=1"));
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, MotorsThatNobodyReleasedAtTheEndAreSaid) {
  for (const bool is_real : {false, true}) {
    const std::string driver = is_real ? "plugin { library: \"/none.so\" }" : "simulated {}";
    files_.write("session.txtpb", "name: \"" + session_name_ + "\" device { " + driver + " }\n");
    LaunchOptions options = this->options();
    options.timing.stop_grace = std::chrono::hours(1);
    start_launcher(options);
    const std::map<std::string, pid_t> nodes = started_nodes(3);

    kill(nodes.at("device_node"), SIGSTOP);
    kill(launcher_, SIGTERM);
    ASSERT_NE(log_with("event=stopping"), "");
    kill(nodes.at("device_node"), SIGKILL);

    while (next_event().substr(0, 8) != "launcher") continue;
    EXPECT_EQ(launcher_status(), is_real ? 1 : 0);
    EXPECT_EQ(log_with("node=device ").find("the motors may still push") != std::string::npos,
              is_real);
  }
}

TEST_F(Launch, ASecondSignalDoesNotWaitForTheGrace) {
  let("device_node", "does_not_stop");
  LaunchOptions options = this->options();
  options.timing.stop_grace = std::chrono::hours(1);
  start_launcher(options);
  started_nodes(3);

  kill(launcher_, SIGINT);
  ASSERT_EQ(next_event(), "device_node signal 15");
  kill(launcher_, SIGINT);

  EXPECT_THAT(next_event(), StartsWith("launcher end=1"));
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, AKilledLauncherLeavesNoNodeBehind) {
  let("mofc_node", "does_not_stop");
  start_launcher(options());
  started_nodes(3);

  kill(launcher_, SIGKILL);

  EXPECT_TRUE(all_nodes_end());
}

// It would answer the next launch.
// A device releases its motors when it is told to end, and not when it is killed.
TEST_F(Launch, ANodeIsToldToEndWhenTheLauncherIsKilled) {
  start_launcher(options());
  started_nodes(3);

  kill(launcher_, SIGKILL);

  std::set<std::string> told;
  while (told.size() < 3) told.insert(next_event());
  EXPECT_THAT(
      told, ElementsAre("device_node signal 15", "mofc_node signal 15", "physics_node signal 15"));
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, AKilledLauncherLeavesNothingBehindThatANodeHasStarted) {
  let("physics_node", "leaves_a_process");
  start_launcher(options());
  started_nodes(3);

  kill(launcher_, SIGKILL);

  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, EndsByItselfWhenItsTimeIsUp) {
  LaunchOptions options = this->options();
  options.seconds = 0.05;
  start_launcher(options);

  std::string event = next_event();
  while (!event.empty() && event.rfind("launcher", 0) != 0) event = next_event();

  EXPECT_EQ(event, "launcher end=0 physics=0 mofc=0 device=0");
  EXPECT_EQ(launcher_status(), 0);
  EXPECT_TRUE(all_nodes_end());
}

TEST_F(Launch, EndsOnAStopRequestAndPollsUntilAllHaveEnded) {
  std::stop_source stop;
  int polls = 0;
  LaunchOptions options = this->options();
  options.poll_interval = milliseconds(1);
  options.on_poll = [&] {
    if (++polls == 3) stop.request_stop();
  };

  const LaunchResult result = launch(options, stop.get_token());

  EXPECT_EQ(result.end, LaunchEnd::kRequested);
  EXPECT_EQ(result.exit_status(), 0);
  EXPECT_GE(polls, 4);  // at least once after the end
}

TEST_F(Launch, AnExceptionOfOnPollLeavesNoNodeBehind) {
  LaunchOptions options = this->options();
  int polls = 0;
  options.on_poll = [&] {
    if (++polls == 2) throw std::runtime_error("no space left");
  };

  EXPECT_THROW(static_cast<void>(launch(options)), std::runtime_error);

  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);  // this process has no child
  EXPECT_EQ(errno, ECHILD);
}

TEST_F(Launch, RemovesTheFilesOfDeadNodesFromTheRunFolder) {
  start_launcher(options());
  auto nodes = started_nodes(3);
  const fs::path folder = run_folder(session_name_);
  const fs::path path = folder / "exchange";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(path.string().size(), sizeof(address.sun_path));
  path.string().copy(address.sun_path, sizeof(address.sun_path));
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  close(socket);
  std::ofstream(folder / "exchange.lock") << nodes["mofc_node"];

  kill(launcher_, SIGTERM);
  EXPECT_EQ(launcher_status(), 0);

  EXPECT_FALSE(fs::exists(folder));
}

TEST_F(Launch, LeavesTheFilesOfANodeStartedByHand) {
  start_launcher(options());
  started_nodes(3);
  const fs::path lock = run_folder(session_name_) / "physics_telemetry.lock";
  const int by_hand = open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  ASSERT_EQ(flock(by_hand, LOCK_EX), 0);

  kill(launcher_, SIGTERM);
  EXPECT_EQ(launcher_status(), 0);

  EXPECT_TRUE(fs::exists(lock));
  close(by_hand);
}

TEST_F(Launch, ASessionIsLaunchedOnceAtATime) {
  start_launcher(options());
  started_nodes(3);

  try {
    static_cast<void>(launch(options()));
    FAIL() << "was launched twice";
  } catch (const SetupError& e) {
    EXPECT_THAT(e.what(), HasSubstr("already launched"));
  }
}

// The launch that held the folder may remove it after this one has opened it.
TEST_F(Launch, ARunFolderThatIsHeldIsThere) {
  std::atomic<int> missing{0};
  const auto hold_often = [&] {
    constexpr int kTimes = 2000;
    for (int i = 0; i < kTimes; ++i) {
      try {
        const RunFolder folder(session_name_);
        if (!folder.is_present()) ++missing;
      } catch (const SetupError&) {  // the other thread holds it
      }
    }
  };
  std::thread other(hold_often);
  hold_often();
  other.join();

  EXPECT_EQ(missing, 0);
}

// A node that is started again would not find the others.
TEST_F(Launch, ARunFolderThatIsRemovedMeanwhileIsSaidOnce) {
  start_launcher(options());
  started_nodes(3);

  fs::remove_all(run_folder(session_name_));

  const std::string said = "event=run_folder_lost folder=" + run_folder(session_name_).string();
  EXPECT_THAT(log_with(said), HasSubstr("remedy=\"stop this launch and start it again"));
  kill(launcher_, SIGTERM);
  EXPECT_EQ(launcher_status(), 0);
  const std::string log = log_with(said);
  EXPECT_EQ(log.find(said), log.rfind(said));
}

TEST_F(Launch, ARunFolderThatAnotherLaunchHasMadeAnewIsNoticedAndLeftAlone) {
  start_launcher(options());
  started_nodes(3);

  fs::rename(run_folder(session_name_), folder_ / "moved");
  const RunFolder of_another(session_name_);

  EXPECT_NE(log_with("event=run_folder_lost"), "");
  kill(launcher_, SIGTERM);
  EXPECT_EQ(launcher_status(), 0);
  EXPECT_TRUE(of_another.is_present());
}

TEST_F(Launch, ARunFolderThatCannotBeCreatedIsASetupErrorWithItsPath) {
  const fs::path not_a_folder = folder_ / "session.txtpb";
  setenv("PALPATE_RUN_DIR", not_a_folder.c_str(), 1);
  try {
    static_cast<void>(launch(options()));
    ADD_FAILURE() << "was launched without a run folder";
  } catch (const SetupError& e) {
    EXPECT_THAT(e.what(), HasSubstr(run_folder(session_name_).string()));
  }
}

TEST_F(Launch, AMissingProgramIsASetupErrorWithItsPath) {
  fs::remove(folder_ / "mofc_node");

  try {
    static_cast<void>(launch(options()));
    FAIL() << "was launched without mofc_node";
  } catch (const SetupError& e) {
    EXPECT_THAT(e.what(), HasSubstr((folder_ / "mofc_node").string()));
  }
  EXPECT_FALSE(fs::exists(folder_ / "mofc_node"));
}

/// Runs one program until it has died `deaths` times.
std::vector<ChildEvent> deaths_of(const fs::path& program, const SupervisorTiming& timing,
                                  std::size_t deaths) {
  boost::asio::io_context io;
  std::vector<ChildEvent> events;
  bool has_ended = false;
  Supervisor* running = nullptr;
  Supervisor supervisor(
      io, {{.name = "child", .program = program, .arguments = {}}}, {}, timing,
      [&](const ChildEvent& event) {
        if (event.kind != ChildEvent::Kind::kDied) return;
        events.push_back(event);
        if (events.size() == deaths) boost::asio::post(io, [&] { running->stop(); });
      },
      [&] { has_ended = true; });
  running = &supervisor;
  supervisor.start();
  io.run_for(kDeadline);
  EXPECT_TRUE(has_ended);
  return events;
}

// 1 ms doubles to the longest, 4 ms.
TEST(Supervisor, BacksOffLongerWithEachDeath) {
  const auto deaths = deaths_of("/bin/false",
                                {.first_back_off = milliseconds(1),
                                 .longest_back_off = milliseconds(4),
                                 .healthy_after = std::chrono::hours(1)},
                                5);

  std::vector<milliseconds> back_offs;
  back_offs.reserve(deaths.size());
  for (const ChildEvent& death : deaths) back_offs.push_back(death.restart_in);
  EXPECT_EQ(back_offs, (std::vector{milliseconds(1), milliseconds(2), milliseconds(4),
                                    milliseconds(4), milliseconds(4)}));
}

TEST(Supervisor, StartsTheBackOffAnewAfterAHealthyRun) {
  const auto deaths = deaths_of(
      "/bin/false", {.first_back_off = milliseconds(1), .healthy_after = milliseconds(0)}, 3);

  for (const ChildEvent& death : deaths) EXPECT_EQ(death.restart_in, milliseconds(1));
}

TEST(Supervisor, DescribesHowAChildEnded) {
  const SupervisorTiming timing{.first_back_off = milliseconds(1)};
  EXPECT_EQ(deaths_of("/bin/false", timing, 1).at(0).how, "exit status 1");

  const test::TempFolder files;
  const fs::path killed = files.write("killed", "#!/bin/sh\nkill -KILL $$\n");
  fs::permissions(killed, fs::perms::owner_all);
  EXPECT_EQ(deaths_of(killed, timing, 1).at(0).how, "killed by signal 9 (Killed)");
}

// For example while its program is being replaced.
TEST(Supervisor, RetriesAChildThatCannotBeRestarted) {
  const test::TempFolder files;
  const fs::path script = files.write("once", "#!/bin/sh\nchmod -x $0\nexit 1\n");
  fs::permissions(script, fs::perms::owner_all);

  const auto deaths = deaths_of(script, {.first_back_off = milliseconds(1)}, 3);

  EXPECT_EQ(deaths.at(0).how, "exit status 1");
  EXPECT_THAT(deaths.at(1).how, HasSubstr("cannot be started: Permission denied"));
  EXPECT_EQ(deaths.at(2).restart_in, milliseconds(4));
}

TEST(Supervisor, AProgramThatCannotBeStartedIsASetupError) {
  EXPECT_THROW(deaths_of("/no/such/program", {}, 1), SetupError);
}

}  // namespace
}  // namespace palpate
