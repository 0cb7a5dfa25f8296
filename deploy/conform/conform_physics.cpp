// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/conform_physics.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <utility>
#include <zmq.hpp>

#include "common/core/check.h"
#include "common/core/user/temp_folder.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "deploy/conform/engine_process.h"
#include "deploy/conform/mofc_side.h"
#include "deploy/conform/tour.h"
#include "deploy/conform/trace.h"
#include "deploy/launch/physics_command.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSession = R"(# what `palpate conform physics` gives to the physics
name: "conform"
device { simulated {} }
physics { rate_hz: 500 }
scene {
  tissue {
    name: "half-space"
    half_space {}
    kelvin_voigt { stiffness_newton_per_m: 400 damping_newton_s_per_m: 1 }
  }
}
)";

constexpr double kLongestSilence_s = 0.15;  // mofc.stale_after_ms at its least
constexpr double kMostDelay_s = 0.02;       // or three periods
constexpr double kFreeNewton = 0.01;
constexpr double kRestNewton = 0.02;  // and 5 % of the force
constexpr double kRestRatio = 0.05;
constexpr double kWatch_s = 2.1;           // at rest
constexpr double kSlowRatio = 0.25;        // of the force, in that time; tissue may relax
constexpr double kLeastRate = 0.5;         // of physics.rate_hz
constexpr double kMostWaiting = 0.1;       // of the time: for a processor
constexpr int kRests = 5;                  // of 0.4 s, the longest time to come to rest
constexpr double kEnergyRatio = 0.05;      // of the work done by and on the tissue
constexpr double kSlideEnergyRatio = 0.2;  // the same, if it is stiffer at one place
constexpr double kEnergyJoule = 20e-6;
constexpr int kSideRounds = 100;         // of 20 ms, without an answer to a side
constexpr std::uint64_t kHopeless = 50;  // refused frames
constexpr auto kStop = std::chrono::milliseconds(3000);

class Suite {
 public:
  explicit Suite(const ConformOptions& options)
      : options_(options), tour_(options.clear_m, options.press_m) {
    // for the ipc files; NOLINTNEXTLINE(concurrency-mt-unsafe): one thread yet
    setenv("PALPATE_RUN_DIR", workplace_.path().c_str(), 1);
    if (!options.session_file.empty()) {
      prepare(options.session_file);
      return;
    }
    const std::string file = workplace_.write("conform.txtpb", kSession);
    try {
      prepare(file);
    } catch (const SetupError& error) {
      // the user does not know that file
      std::string text = error.what();
      for (std::size_t at = 0; (at = text.find(file, at)) != std::string::npos;) {
        text.replace(at, file.size(), "palpate conform");
      }
      throw SetupError(text);
    }
  }

  std::vector<ConformFinding> run() {
    engine_ = std::make_unique<EngineProcess>(program_);
    connect();
    if (!start()) return findings_;
    const TimePoint begin = clock_.now();
    const Duration before = engine_->waited();
    tour_.take(*mofc_);
    rest();
    silence();
    waiting_ratio_ = to_seconds(engine_->waited() - before) / to_seconds(clock_.now() - begin);
    motion_findings();
    sides();
    peers();
    restart_of_mofc();
    suspension();
    restart_of_physics();
    stop();
    return findings_;
  }

 private:
  void prepare(const fs::path& file) {
    session_ = load_session(file, options_.overrides);
    if (!options_.command.empty()) take_command(file);
    if (session_.physics_command.empty()) {
      throw SetupError((options_.session_file.empty() ? "no command" : options_.session_file) +
                       ": which physics? Give its program and arguments behind --, or a session "
                       "with physics.command");
    }
    fs::create_directories(run_folder(session_.name));
    program_ =
        physics_from_elsewhere(session_, file, options_.overrides, session_.security.may_be_plain);
    if (!options_.command.empty()) program_.folder = fs::current_path();
    context_ = std::make_unique<ZmqContext>(tcp_rules(session_.security, {KeyRole::kDevice}));
  }

  /// The command of the options instead of that of the session.
  void take_command(const fs::path& session_file) {
    session_.physics_command = options_.command;
    for (std::string& word : session_.physics_command) {
      if (word == "{session}") word = fs::absolute(session_file).string();
    }
    std::string& program = session_.physics_command.front();
    if (program.find('/') != std::string::npos) program = fs::absolute(program).string();
  }

  void find(const std::string& check, const std::string& problem, const std::string& good,
            const std::string& remedy) {
    findings_.push_back({.check = check,
                         .is_good = problem.empty(),
                         .text = problem.empty() ? good : problem,
                         .remedy = problem.empty() ? "" : remedy});
    if (options_.on_finding) options_.on_finding(findings_.back());
  }

  /// What a program also falls short in if it gets no processor.
  void find_in_time(const std::string& check, const std::string& problem, const std::string& good,
                    const std::string& remedy) {
    if (problem.empty() || waiting_ratio_ < kMostWaiting) {
      find(check, problem, good, remedy);
      return;
    }
    findings_.push_back(
        {.check = check,
         .is_good = false,
         .text = fmt::format("not judged: the program waited for a processor in {:.0f} % of the "
                             "time, and {}",
                             100.0 * waiting_ratio_, problem),
         .remedy = "try again where nothing else runs",
         .is_checked = false});
    if (options_.on_finding) options_.on_finding(findings_.back());
  }

  void find_stamps() {
    find("stamps", mofc_->wrong_stamp(), "every answer echoes a motion, in order",
         "see Interaction in docs/wire.md");
  }
  void find_frames() {
    const Rejections& refused = mofc_->rejections();
    find("frames",
         refused.total() == 0
             ? ""
             : fmt::format("{} frames refused: {}", refused.total(), explain(refused.latest())),
         "every frame is within the ranges of the wire", "see the ranges in docs/wire.md");
  }

  void connect() {
    mofc_.reset();  // one writer at a time
    mofc_ = std::make_unique<MofcSide>(*context_, session_.side(), clock_, random_session_id());
  }

  bool start() {
    const TimePoint begin = clock_.now();
    bool has_answer = false;
    // what cannot be understood will not become better
    while (!has_answer && engine_->is_running() && mofc_->wrong_stamp().empty() &&
           mofc_->rejections().total() < kHopeless &&
           to_seconds(clock_.now() - begin) < options_.seconds_to_start) {
      has_answer = mofc_->await_answer(options_.clear_m, 0.1);
    }
    std::string problem;
    if (!engine_->is_running()) {
      const int status = engine_->wait(std::chrono::milliseconds(0)).value_or(0);
      problem = fmt::format("it ended with status {} before its first answer", status);
    } else if (!has_answer) {
      problem = fmt::format("no answer within {:g} s", options_.seconds_to_start);
      // it speaks, but not so that it is understood
      if (mofc_->rejections().total() > 0) {
        find_frames();
        return false;
      }
      if (!mofc_->wrong_stamp().empty()) {
        find_stamps();
        return false;
      }
    }
    find("start", problem,
         fmt::format("first answer after {:.1f} s", to_seconds(clock_.now() - begin)),
         "bind links.tool_motion and links.interaction of PALPATE_PHYSICS, read its message above, "
         "see docs/wire.md");
    return problem.empty();
  }

  void contact_findings() {
    find("contacts", tour_.models().contacts_problem(), "each answer agrees with its contacts",
         "normal_world points out of the tissue; force_on_tool_newton is that on the tool, of a "
         "contact what its law gives at the reference, and the sum over the contacts; SI units; "
         "only contacts with is_adhesive pull, and only while they touch");
    const std::string found =
        fmt::format("the contacts predict the next forces, a quarter of them to {:.1f} %",
                    100.0 * tour_.models().worst_error());
    find_in_time(
        "model", tour_.models().model_problem(),
        tour_.models().is_compared() ? found : "no contacts to compare",
        "the law of a contact holds around the reference, up to its trust_radius_m: "
        "d_force_d_position is the derivative of its elastic force, negative along the normal for "
        "tissue that resists, surface_velocity_world_m_per_s that of the tissue");
  }

  void rest() {
    Variation pressed;
    for (int i = 0; i < kRests; ++i) {  // until the engine has come to rest
      mofc_->follow([this](double) { return options_.press_m; }, 0.4);
      const std::vector<AnsweredPlace> trace = mofc_->take_trace();
      pressed = variation_of(trace, trace.size() / 3);
      if (pressed.range_newton <= kRestNewton + kRestRatio * pressed.most_newton) break;
    }
    // then for long: what varies slowly is calm for a while
    mofc_->follow([this](double) { return options_.press_m; }, kWatch_s);
    const std::vector<AnsweredPlace> watched = mofc_->take_trace();
    tour_.models().add_rest(watched);
    const Variation slow = variation_of(watched, 0);
    const bool moves_itself = is_moving(watched);
    tour_.leave(*mofc_);
    static_cast<void>(mofc_->take_trace());
    mofc_->follow([this](double) { return options_.clear_m; }, 0.2);
    const std::vector<AnsweredPlace> free = mofc_->take_trace();

    const Vector3 out = (options_.clear_m - options_.press_m).normalized();
    const double outward = pressed.mean_newton.dot(out);
    const double force = pressed.most_newton;
    const double range = pressed.range_newton;
    double in_the_air = 0.0;
    for (const AnsweredPlace& one : free)
      in_the_air = std::max(in_the_air, one.force_newton.norm());
    std::string problem;
    if (in_the_air > kFreeNewton) {
      problem = fmt::format("{:.3g} N on a tool that touches nothing", in_the_air);
    } else if (force <= kFreeNewton) {
      problem = "no force where the tool should press, so the other checks say little";
    } else if (outward < -kFreeNewton) {
      problem =
          fmt::format("the tissue pulls the pressed tool further in, with {:.3g} N", -outward);
    } else if (!moves_itself && range > kRestNewton + kRestRatio * force) {
      problem = fmt::format(
          "the force varies by {:.3g} N on a tool at rest, pressing with {:.3g} N", range, force);
    } else if (!moves_itself && slow.range_newton > kRestNewton + kSlowRatio * slow.most_newton) {
      problem = fmt::format(
          "the force varies slowly on a tool at rest, by {:.3g} N in {:.2g} s, pressing with "
          "{:.3g} N",
          slow.range_newton, kWatch_s, slow.most_newton);
    }
    find("rest", problem, fmt::format("{:.3g} N pressed, 0 N free, steady", force),
         outward < -kFreeNewton && in_the_air <= kFreeNewton
             ? "force_on_tool_newton acts on the tool, not on the tissue: reverse its sign"
         : in_the_air > kFreeNewton || force <= kFreeNewton
             ? "send the force of the tissue alone; say where it is: --clear X Y Z --press X Y Z"
             : "let the engine come to rest: more iterations or damping, no random forces");
  }

  void silence() {
    // not what is still under way
    for (int i = 0; i < 100 && !mofc_->has_all_answers(); ++i) mofc_->listen(0.01);
    const std::size_t answers = mofc_->listen(0.3);
    find("silence",
         answers >= 2 ? "" : fmt::format("{} answers in 0.3 s without a motion", answers),
         fmt::format("{} answers in 0.3 s without a motion", answers),
         "answer the newest motion again once per period: mofc_node takes silence for a dead "
         "physics");
  }

  void motion_findings() {
    const double period_s = 1.0 / session_.physics.rate_hz;
    find_in_time(
        "answers",
        mofc_->longest_silence_s() <= kLongestSilence_s
            ? ""
            : fmt::format("{:.0f} ms without an answer while the tool moved",
                          1e3 * mofc_->longest_silence_s()),
        fmt::format("at most {:.0f} ms apart", 1e3 * mofc_->longest_silence_s()),
        "step at physics.rate_hz, or set it to what the engine can do; mofc.stale_after_ms must be "
        "longer than its pauses");
    const double rate_hz = mofc_->rate_hz();
    const std::string rate =
        fmt::format("{:.0f} answers per second, of {:g}", rate_hz, session_.physics.rate_hz);
    find_in_time("rate", rate_hz >= kLeastRate * session_.physics.rate_hz ? "" : rate, rate,
                 "step at physics.rate_hz, or set it to what the engine can do");
    std::vector<double> delays = mofc_->delays_s();
    std::sort(delays.begin(), delays.end());
    const double median = delays.empty() ? 0.0 : delays[delays.size() / 2];
    const double most = std::max(kMostDelay_s, 3.0 * period_s);
    find_in_time(
        "delay",
        median <= most ? "" : fmt::format("answers are {:.1f} ms late (median)", 1e3 * median),
        fmt::format("{:.1f} ms (median)", 1e3 * median),
        fmt::format("answer the newest motion, not a queue of old ones, within {:.0f} ms",
                    1e3 * most));
    find_stamps();
    find_frames();
    find_in_time(
        "jumps",
        tour_.worst_jump_newton() == 0.0
            ? ""
            : fmt::format("the force jumps by {:.3g} N while the tool moves by {:.3g} mm",
                          tour_.worst_jump_newton(), 1e3 * tour_.worst_jump_m()),
        "the force follows the motion without a jump",
        "look for contacts that come and go, a solver that does not converge, or stiffness beyond "
        "10 kN/m");
    contact_findings();
    std::string problem;
    for (const Loop& loop : tour_.loops()) {
      const auto [work, size] = work_joule(loop.trace);
      if (problem.empty() &&
          work > kEnergyJoule + (loop.has_slide ? kSlideEnergyRatio : kEnergyRatio) * size) {
        problem = fmt::format("{} gives the hand {:.3g} mJ", loop.name, 1e3 * work);
      }
    }
    find_in_time(
        "energy", problem, "closed paths give the hand no energy",
        "let the force be the gradient of a stored energy, less damping; a force that lags behind "
        "the motion gives energy too: answer with the force of the pose that is answered");
  }

  /// Each has its own endpoints.
  void sides() {
    std::string problem;
    for (std::size_t i = 1; i < session_.sides.size(); ++i) {
      MofcSide other(*context_, session_.sides[i], clock_, random_session_id());
      bool has_answer = false;
      for (int round = 0; round < kSideRounds && !has_answer; ++round) {
        mofc_->follow([this](double) { return options_.clear_m; }, 0.01);
        has_answer = other.await_answer(options_.clear_m, 0.01);
      }
      if (!has_answer && problem.empty()) {
        problem = "side \"" + session_.sides[i].name + "\" is never answered";
      }
    }
    if (session_.sides.size() < 2) return;
    find("sides", problem, fmt::format("each of {} is answered", session_.sides.size()),
         "bind the endpoints of every side of PALPATE_PHYSICS, and answer each");
  }

  void peers() {
    const std::string& endpoint = session_.side().links.tool_motion;
    if (!session_.security.key_folder.empty()) return;  // nobody without keys gets in
    zmq::socket_t rude(context_->get(), zmq::socket_type::push);
    rude.set(zmq::sockopt::linger, 0);
    rude.connect(endpoint);
    Codec<ToolMotion> codec;
    ToolMotion motion;
    motion.header.session_id = 77;
    motion.device_session_id = 78;
    motion.tool_position_world_m = Vector3::Constant(std::nan(""));
    std::vector<std::byte> valid(codec.encode(motion));
    codec.write(valid.data());
    std::vector<std::vector<std::byte>> frames{{}, {std::byte{3}}, valid};
    frames.emplace_back(100, std::byte{0xff});
    frames.emplace_back(std::vector<std::byte>(5000, std::byte{3}));
    frames.push_back(valid);
    frames.back().resize(valid.size() / 2);
    frames.push_back(valid);
    frames.back().front() = std::byte{4};
    for (int round = 0; round < 5; ++round) {
      for (const auto& frame : frames) {
        rude.send(zmq::buffer(frame), zmq::send_flags::dontwait);
      }
      mofc_->follow([this](double) { return options_.clear_m; }, 0.04);
    }
    // a second mofc_node, elsewhere, while the first one is served
    MofcSide second(*context_, session_.side(), clock_, random_session_id());
    std::string problem;
    for (int round = 0; round < 20; ++round) {
      static_cast<void>(second.await_answer(options_.press_m, 0.004));
      mofc_->follow([this](double) { return options_.clear_m; }, 0.008);
    }
    // the second one gets a copy of the answers to the first: those are no fault
    if (!second.delays_s().empty()) {
      problem = "a second sender of motions was served beside the first one";
    } else if (!engine_->is_running()) {
      problem = "it ended after malformed motions";
    } else if (!mofc_->await_answer(options_.clear_m, 2.0)) {
      problem = "no answer after malformed motions and a second sender";
    }
    find(
        "peers", problem, "malformed motions and a second sender change nothing",
        "refuse a frame as a whole, and another session while the first one speaks (docs/wire.md)");
  }

  void restart_of_mofc() {
    mofc_.reset();
    clock_.sleep_until(clock_.now() + std::chrono::milliseconds(300));
    connect();
    const bool has_answer = mofc_->await_answer(options_.clear_m, 3.0);
    find("mofc restart", has_answer ? "" : "no answer to a mofc_node that was started again",
         "a mofc_node that was started again is served",
         "accept a new session_id when the old one has been silent for 100 ms, and its "
         "subscription");
  }

  void suspension() {
    engine_->send_signal(SIGSTOP);
    mofc_->follow([this](double) { return options_.clear_m; }, 0.4);
    engine_->send_signal(SIGCONT);
    const bool has_answer = mofc_->await_answer(options_.clear_m, 3.0);
    find("suspension", has_answer ? "" : "no answer after it was suspended for 0.4 s",
         "it answers again after it was suspended",
         "go on with the newest motion after a pause, as after SIGSTOP and SIGCONT");
  }

  void restart_of_physics() {
    const std::uint64_t before = mofc_->physics_session();
    engine_->send_signal(SIGKILL);
    static_cast<void>(engine_->wait(kStop));
    engine_ = std::make_unique<EngineProcess>(program_);
    const bool has_answer = mofc_->await_answer(options_.clear_m, options_.seconds_to_start);
    std::string problem;
    if (!has_answer) {
      problem = "no answer after it was killed and started again";
    } else if (mofc_->physics_session() == before) {
      problem = "the same header.session_id after a restart";
    }
    find("restart", problem, "it answers again after it was killed",
         "draw a random header.session_id at every start, and bind to endpoints that a killed "
         "program has left");
  }

  void stop() {
    engine_->send_signal(SIGTERM);
    const std::optional<int> status = engine_->wait(kStop);
    std::string problem;
    if (!status) {
      problem = "it still runs 3 s after SIGTERM";
    } else if (*status != 0) {
      problem = fmt::format("status {} after SIGTERM", *status);
    }
    find("stop", problem, "status 0 after SIGTERM", "end with status 0 on SIGTERM, within 2 s");
  }

  const ConformOptions& options_;
  TempFolder workplace_;
  Session session_;
  ChildSpec program_;
  SteadyClock clock_;
  std::unique_ptr<ZmqContext> context_;
  std::unique_ptr<EngineProcess> engine_;
  std::unique_ptr<MofcSide> mofc_;
  Tour tour_;
  double waiting_ratio_ = 0.0;  // of the time of the motions: the program, for a processor
  std::vector<ConformFinding> findings_;
};

}  // namespace

std::vector<ConformFinding> conform_physics(const ConformOptions& options) {
  return Suite(options).run();
}

}  // namespace palpate
