// SPDX-License-Identifier: Apache-2.0
// stations_bench — how many hands one physics_node serves: a real physics_node, and as many ends of
// hops 2 and 3 as there are hands, in this process.
//
//   stations_bench [--quick] [--json FILE] [--csv FILE]
#include <sched.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/session/session_file.h"
#include "tests/bench/bench_output.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate::bench {
namespace {

using namespace std::chrono_literals;

constexpr double kRate_hz = 250.0;

std::string session_of(int hands) {
  std::string text =
      "name: \"stations\"\nphysics { rate_hz: 250 }\n"
      "scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } "
      "} tissue { sphere { center_m { x: 0.1 } radius_m: 0.03 } kelvin_voigt { "
      "stiffness_newton_per_m: 800 damping_newton_s_per_m: 2 } } }\n";
  for (int i = 0; hands > 1 && i < hands; ++i) {
    text += "side { name: \"hand" + std::to_string(i) + "\" }\n";
  }
  return text;
}

/// Processor time of a process so far [s].
double processor_s(pid_t process) {
  std::ifstream stat("/proc/" + std::to_string(process) + "/stat");
  std::string text;
  std::getline(stat, text);
  std::istringstream rest(text.substr(text.rfind(") ") + 2));
  std::string field;
  for (int i = 0; i < 11; ++i) rest >> field;
  double user = 0.0;
  double system = 0.0;
  rest >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// The ends of one hand.
struct Hand {
  Hand(ZmqContext& context, const Clock& clock, const LinksConfig& links, std::uint64_t id)
      : motions(context, connect_to(links.tool_motion, "links.tool_motion")),
        interactions(context, clock, connect_to(links.interaction, "links.interaction")) {
    motion.header.session_id = id;
    motion.device_session_id = id;
  }
  ZmqSender<ToolMotion> motions;
  ZmqSource<Interaction> interactions;
  ToolMotion motion;
  std::uint64_t answers = 0;
  std::uint64_t sequence = 0;  // of the newest answer
  std::uint64_t skipped = 0;   // sequence numbers missing: dropped on the way
};

void measure(int hands, double seconds, Table& table) {
  const test::RunFolder run_folder;
  test::TempFolder files;
  const std::string file = files.write("stations.txtpb", session_of(hands));
  const Session session = load_session(file);
  test::Program physics("physics_node", {"--session", file, "--no-realtime"});
  const SteadyClock clock;
  ZmqContext context;
  std::vector<std::unique_ptr<Hand>> all;
  for (std::size_t i = 0; i < session.sides.size(); ++i) {
    all.push_back(std::make_unique<Hand>(context, clock, session.sides[i].links, i + 1));
  }

  // all hands press; a motion per period and hand
  const auto turn = [&](TimePoint now) {
    Interaction answer;
    TimePoint at;
    for (const auto& hand : all) {
      while (hand->interactions.receive(answer, at)) {
        if (hand->answers > 0) hand->skipped += answer.header.sequence - hand->sequence - 1;
        hand->sequence = answer.header.sequence;
        ++hand->answers;
      }
      ToolMotion& motion = hand->motion;
      motion.header.sampled_at = motion.device_sampled_at = now;
      motion.tool_position_world_m = {0.0, 0.0, -2e-3};
      hand->motions.send(motion);
      ++motion.header.sequence;
      ++motion.device_sequence;
    }
  };
  const auto run_until = [&](TimePoint end) {
    for (TimePoint next = clock.now(); next < end; next += from_seconds(1.0 / kRate_hz)) {
      SteadyClock().sleep_until(next);
      turn(clock.now());
    }
  };
  const TimePoint start_limit = clock.now() + 20s;
  const auto are_heard = [&] {
    return std::all_of(all.begin(), all.end(), [](const auto& hand) { return hand->answers > 0; });
  };
  while (!are_heard()) {
    if (clock.now() > start_limit)
      throw SetupError("physics_node does not answer: " + physics.err());
    run_until(clock.now() + 100ms);
  }
  for (const auto& hand : all) hand->answers = hand->skipped = 0;

  const double processor_before_s = processor_s(physics.pid());
  const TimePoint begin = clock.now();
  run_until(begin + from_seconds(seconds));
  const double wall_s = to_seconds(clock.now() - begin);
  const double used_s = processor_s(physics.pid()) - processor_before_s;
  physics.send_signal(SIGTERM);
  physics.wait();

  std::uint64_t sum = 0;
  std::uint64_t dropped = 0;
  std::uint64_t least = UINT64_MAX;
  std::uint64_t most = 0;
  for (const auto& hand : all) {
    sum += hand->answers;
    dropped += hand->skipped;
    least = std::min(least, hand->answers);
    most = std::max(most, hand->answers);
  }
  const double made = static_cast<double>(sum + dropped);
  const double due = kRate_hz * wall_s * hands;
  table.add({static_cast<double>(hands), 100.0 * used_s / wall_s, 100.0 * used_s / wall_s / hands,
             1e6 * used_s / made, static_cast<double>(least) / wall_s,
             static_cast<double>(most) / wall_s,
             static_cast<double>(least) / static_cast<double>(most),
             100.0 * std::max(0.0, 1.0 - made / due), 100.0 * static_cast<double>(dropped) / made});
}

void run(const BenchOptions& options) {
  Table table({{"hands", "hands", "{:.0f}"},
               {"processor_percent", "processor %", "{:.1f}"},
               {"processor_percent_per_hand", "% per hand", "{:.2f}"},
               {"answer_us", "µs per answer", "{:.1f}"},
               {"least_answers_per_s", "answers/s, least", "{:.1f}"},
               {"most_answers_per_s", "most", "{:.1f}"},
               {"fairness", "least/most", "{:.3f}"},
               {"skipped_percent", "turns skipped %", "{:.2f}"},
               {"dropped_percent", "not read here %", "{:.2f}"}});
  const std::vector<int> hands =
      options.is_quick ? std::vector<int>{1, 8, 50} : std::vector<int>{1, 2, 4, 8, 16, 32, 50};
  for (const int count : hands) measure(count, options.is_quick ? 3.0 : 10.0, table);
  table.publish(options);
  std::printf(
      "\nOne physics_node at 250 Hz, two tissues, every hand in contact and sending 250 motions/s. "
      "Processor: of one core, by physics_node. The hands share this machine with it.\n");
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("How many hands one physics_node serves: cost per hand, fairness, what is skipped.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
