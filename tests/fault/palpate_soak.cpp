// SPDX-License-Identifier: Apache-2.0
// palpate_soak — a long session whose nodes are killed, ended and suspended at random.
//
//   palpate_soak [MINUTES [SEED]]     0.4 minutes and seed 1 by default
//
// `palpate launch` with a recording, and three viewers, on the default session at 1 kHz. Every few
// seconds a fault hits a random process; in the second half none is killed, so that the last life
// of each process is long enough to see whether its memory grows. Fails if memory grows, if the
// hand receives energy, if there is no contact at the end, or if the recording is incomplete.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/process/process_links.h"
#include "common/session/session_file.h"
#include "common/telemetry/metrics.h"
#include "tests/support/machine/places.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/process.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::kRoundingJoule;
using test::Program;

double asked_minutes = 0.4;
unsigned asked_seed = 1;

/// After this time the memory of a process is stable; a short run takes a quarter of its length.
constexpr Duration kWarmUp = 60s;
Duration warm_up() { return std::min(kWarmUp, from_seconds(60.0 * asked_minutes / 4.0)); }
/// Allowed growth afterwards, for rarely used buffers. A short run detects coarse leaks only.
double allowed_kibibyte() { return warm_up() < kWarmUp ? 6144.0 : 768.0; }

/// Resident memory in KiB; 0 if there is no such process.
double resident_kibibyte(pid_t process) {
  std::ifstream statm("/proc/" + std::to_string(process) + "/statm");
  double size = 0.0;
  double resident_pages = 0.0;
  statm >> size >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1024.0;
}

/// Memory of one process from the end of its warm-up on.
struct Life {
  pid_t process = 0;
  TimePoint seen_at{};  ///< first
  TimePoint warm_at{};
  TimePoint last_at{};
  double warm_kibibyte = 0.0;
  double last_kibibyte = 0.0;

  void look(pid_t now_process, TimePoint now) {
    if (now_process != process) *this = {.process = now_process, .seen_at = now};
    const double kibibyte = resident_kibibyte(process);
    if (kibibyte == 0.0 || now - seen_at < warm_up()) return;
    if (warm_kibibyte == 0.0) {
      warm_kibibyte = kibibyte;
      warm_at = now;
    }
    last_kibibyte = kibibyte;
    last_at = now;
  }
  [[nodiscard]] double minutes() const { return to_seconds(last_at - warm_at) / 60.0; }
  [[nodiscard]] double growth_kibibyte() const { return last_kibibyte - warm_kibibyte; }
};

class Soak : public testing::Test {
 protected:
  Soak() {
    const std::vector<std::string> arguments{"--set", "name=soak", "--set", "viewer.web.port=0"};
    const auto with = [&](std::vector<std::string> first) {
      first.insert(first.end(), arguments.begin(), arguments.end());
      return first;
    };
    session_ = load_session(kSession, {"name=soak"});
    feed_ = std::make_unique<viewer::TelemetryFeed>(session_, clock_, links_);
    mirror_.on_row = [this](const TickRow& row) {
      ++rows_;
      lateness_.add(row.device.lateness);
      if (row.device.is_answered) reply_time_.add(row.device.reply_time);
      least_energy_joule_ = std::min(least_energy_joule_, row.device.minimum_true_energy_joule);
      largest_newton_ = std::max(largest_newton_, row.device.force_on_hand_newton.norm());
    };
    launch_ = std::make_unique<Program>(
        "palpate", with({"launch", kSession, "--record", recording_, "--json", summary_}));
    for (auto& viewer : viewers_) {
      viewer = std::make_unique<Program>("viewer_node", with({"--session", kSession, "--quiet"}));
    }
  }

  /// Takes telemetry, and measures the memory of all processes once a second.
  void look_until(TimePoint end) {
    for (TimePoint now = clock_.now(); now < end; now = clock_.now()) {
      feed_->pump({&mirror_, 1}, std::min(end, now + 20ms));
      if (now < next_look_) continue;
      next_look_ = now + 1s;
      for (const auto& [name, process] : processes()) lives_[name].look(process, now);
    }
  }

  /// The newest process of each name.
  std::map<std::string, pid_t> processes() {
    std::map<std::string, pid_t> all{{"launch", launch_->pid()}};
    for (std::size_t i = 0; i < viewers_.size(); ++i) {
      all["viewer " + std::to_string(i + 1)] = viewers_[i]->pid();
    }
    const std::string said = launch_->err();
    for (const char* node : kNodes) {
      const std::string text = std::string("event=node_started node=") + node + " pid=";
      const std::size_t at = said.rfind(text);
      if (at != std::string::npos) all[node] = std::stoi(said.substr(at + text.size(), 20));
    }
    return all;
  }

  /// Does a random fault to a random process.
  void do_fault(bool may_kill) {
    const auto any = [&](int from, int to) {
      return std::uniform_int_distribution<int>(from, to)(random_);
    };
    const bool kills = may_kill && any(0, 2) == 0;
    const int who = any(0, kills ? 3 : 5);
    const auto all = processes();
    const auto process = all.find(who < 4 ? kNodes[static_cast<std::size_t>(who)]
                                          : "viewer " + std::to_string(who - 3));
    if (process == all.end() || resident_kibibyte(process->second) == 0.0)
      return;  // being restarted
    if (kills) {
      const int signal = any(0, 1) == 0 ? SIGKILL : SIGTERM;
      ++faults_[signal == SIGKILL ? "killed" : "ended"];
      kill(process->second, signal);
      return;
    }
    ++faults_["suspended"];
    kill(process->second, SIGSTOP);
    look_until(clock_.now() + std::chrono::milliseconds(any(5, 500)));
    kill(process->second, SIGCONT);
  }

  static inline const std::string kSession = test::source_dir() + "/deploy/sessions/default.txtpb";
  static constexpr std::array kNodes{"physics", "mofc", "device", "viewer"};

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string recording_ = (files_.path() / "run.mcap").string();
  std::string summary_ = (files_.path() / "run.json").string();
  std::mt19937 random_{asked_seed};
  Session session_;
  SteadyClock clock_;
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  viewer::TelemetryMirror mirror_;
  std::unique_ptr<viewer::TelemetryFeed> feed_;
  std::unique_ptr<Program> launch_;
  std::array<std::unique_ptr<Program>, 2> viewers_;

  std::uint64_t rows_ = 0;
  DurationHistogram lateness_;
  DurationHistogram reply_time_;
  double least_energy_joule_ = 0.0;
  double largest_newton_ = 0.0;
  std::map<std::string, int> faults_{{"killed", 0}, {"ended", 0}, {"suspended", 0}};
  std::map<std::string, Life> lives_;
  TimePoint next_look_{};
};

TEST_F(Soak, MemoryDoesNotGrowAndTheHandNeverReceivesEnergy) {
  const test::QuietMachine machine;
  const TimePoint begin = clock_.now();
  const Duration length = from_seconds(60.0 * asked_minutes);
  const TimePoint end = begin + length;
  const auto quiet_end = 3s;  // for processes that were suspended or killed to recover
  std::uniform_real_distribution<double> pause_s(0.5, 3.0);
  while (clock_.now() < end - quiet_end) {
    look_until(std::min(clock_.now() + from_seconds(pause_s(random_)), end - quiet_end));
    do_fault(clock_.now() < begin + length / 2);
  }
  // the hand presses every 1.4 s
  const std::uint64_t contact_ticks = mirror_.mofc_counters().contact_ticks;
  const TimePoint deadline = clock_.now() + test::patience(quiet_end);
  do look_until(std::max(end, clock_.now() + 1s));
  while (clock_.now() < deadline && mirror_.mofc_counters().contact_ticks <= contact_ticks);
  EXPECT_GT(mirror_.mofc_counters().contact_ticks, contact_ticks);
  EXPECT_TRUE(mirror_.device_link().is_alive(clock_.now()));

  for (auto& viewer : viewers_) {
    viewer->send_signal(SIGTERM);
    EXPECT_EQ(viewer->wait(), 0) << viewer->err();
  }
  launch_->send_signal(SIGTERM);
  EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  const auto info =
      nlohmann::json::parse(test::run_program("palpate", {"info", recording_, "--json"}).out);
  EXPECT_TRUE(info["is_whole"]);
  EXPECT_GE(least_energy_joule_, -kRoundingJoule);

  // report
  const auto micro = [](const DurationHistogram& of, double q) {
    return static_cast<double>(of.quantile(q).count()) * 1e-3;
  };
  const auto lost = [](const char* node, const viewer::NodeLink& link) {
    std::printf("  telemetry of %-8s %llu of %llu batches lost, %llu sessions\n", node,
                static_cast<unsigned long long>(link.batches_lost),
                static_cast<unsigned long long>(link.batches_received) + link.batches_lost,
                static_cast<unsigned long long>(link.sessions));
  };
  std::printf("soak: %.1f minutes, seed %u: %d killed, %d ended, %d suspended\n", asked_minutes,
              asked_seed, faults_["killed"], faults_["ended"], faults_["suspended"]);
  std::printf("  least true energy     %.3f µJ, largest force %.2f N\n", 1e6 * least_energy_joule_,
              largest_newton_);
  std::printf("  ticks                 %llu of %.0f seen\n", static_cast<unsigned long long>(rows_),
              to_seconds(length) * session_.side().device.rate_hz);
  for (const auto& [name, of] :
       {std::pair<const char*, const DurationHistogram&>("lateness", lateness_),
        std::pair<const char*, const DurationHistogram&>("reply", reply_time_)}) {
    std::printf("  %-21s p50 %.0f, p99 %.0f, p99.9 %.0f, max %.0f µs\n", name, micro(of, 0.5),
                micro(of, 0.99), micro(of, 0.999), micro(of, 1.0));
  }
  lost("device", mirror_.device_link());
  lost("mofc", mirror_.mofc_link());
  lost("physics", mirror_.physics_link());
  std::printf("  recording             %s MB, dropped messages %s\n",
              std::to_string(info["bytes"].get<std::uint64_t>() / 1'000'000).c_str(),
              info["loss"]["messages_dropped"].get<std::string>().c_str());
  for (const auto& [name, life] : lives_) {
    std::printf("  memory of %-11s %.0f KiB, %+.0f in its last %.1f minutes\n", name.c_str(),
                life.last_kibibyte, life.growth_kibibyte(), life.minutes());
    EXPECT_GT(life.minutes(), 0.0) << name << " did not live long enough";
    // what starts slowly is still growing after the warm-up
    if (life.growth_kibibyte() > allowed_kibibyte() && !machine.may_check("memory of " + name)) {
      continue;
    }
    EXPECT_LE(life.growth_kibibyte(), allowed_kibibyte()) << name;
  }
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  if (argc > 1) palpate::asked_minutes = std::atof(argv[1]);
  if (argc > 2) palpate::asked_seed = static_cast<unsigned>(std::atoi(argv[2]));
  if (!(palpate::asked_minutes >= 0.3)) {
    std::fprintf(stderr, "palpate_soak [MINUTES [SEED]]: at least 0.3 minutes\n");
    return 2;
  }
  return RUN_ALL_TESTS();
}
