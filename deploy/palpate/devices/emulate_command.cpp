// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/process/options.h"
#include "common/process/realtime.h"
#include "common/process/terminal.h"
#include "common/telemetry/summary.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/options.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/emulators/damiao_emulator.h"
#include "device_node/emulators/dynamixel_emulator.h"
#include "device_node/emulators/falcon_emulator.h"
#include "device_node/emulators/hapi_emulator.h"
#include "device_node/emulators/haply_emulator.h"
#include "device_node/emulators/wooden_emulator.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

/// The force of a real device goes on for some time when its messages stop; nothing is documented.
constexpr Duration kEmulatedWatchdog = 20ms;

/// A name for a pseudo-terminal, as long as the object exists.
class TerminalLink {
 public:
  /// @param setting  that says the name   @param remedy  for one that cannot be had
  TerminalLink(const std::string& terminal, const std::string& name, const std::string& setting,
               const std::string& remedy)
      : name_(name) {
    const fs::file_status status = fs::symlink_status(name_);
    const bool is_old =
        fs::is_symlink(status) && fs::read_symlink(name_).string().starts_with("/dev/pts/");
    if (fs::exists(status) && !is_old) {
      throw SetupError(setting + ": \"" + name +
                       "\" exists, and no emulator made it; give the emulator a new name with " +
                       remedy);
    }
    std::error_code error;
    fs::remove(name_, error);
    fs::create_symlink(terminal, name_, error);
    if (error) {
      throw SetupError(setting + ": \"" + name + "\": " + error.message() +
                       "; give the emulator a new name with " + remedy);
    }
  }
  ~TerminalLink() {
    std::error_code passed;
    fs::remove(name_, passed);
  }
  TerminalLink(const TerminalLink&) = delete;
  TerminalLink& operator=(const TerminalLink&) = delete;

 private:
  fs::path name_;
};

struct EmulateCommand {
  SessionOptions session;
  std::string side;
  std::string leader;
  std::string bus = "dynamixel";
  std::vector<std::string> faults;
  double seconds = 0.0;
  bool is_let_go = false;
  bool has_no_realtime = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    app.get_option("SESSION")->required(false);
    app.add_option("--leader", leader,
                   "instead of a session's device: a leader arm of seven motors on a bus of this "
                   "name, such as /tmp/leader")
        ->type_name("PORT");
    app.add_option("--bus", bus,
                   "of the leader arm: dynamixel (servos on a serial port, the default) or openarm "
                   "(Damiao motors on a CAN bus, as a socket)")
        ->check(CLI::IsMember({"dynamixel", "openarm"}))
        ->needs("--leader");
    add_side_option(app, side);
    app.add_option("--fault", faults,
                   fmt::format("KIND@SECONDS:MILLISECONDS, a fault of the wire, such as "
                               "unplugged@2:500; KIND is one of {{{}}}",
                               fmt::join(device::fault_kinds(), ", ")))
        ->type_name("FAULT");
    app.add_flag(
        "--hands-off", is_let_go,
        "nobody holds the device, as `palpate identify` requires; its buttons are pressed as "
        "hand { press } says");
    add_no_realtime_flag(app, has_no_realtime);
    app.add_option("--seconds", seconds, "end after this time; without it at Ctrl-C")
        ->check(CLI::PositiveNumber);
  }

  int run(const Verbosity& verbosity) const {
    if (!leader.empty()) return emulate_leader();
    if (session.file.empty()) {
      throw SetupError("emulate: what? Give a SESSION, or --leader PORT for a leader arm");
    }
    const Session whole = with_only_side(session.load(verbosity), side);
    const Side& emulated = whole.side();
    std::vector<device::PlannedFault> planned;
    for (const std::string& fault : faults) {
      planned.push_back(device::parse_fault(fault, device::driver_name(emulated.driver)));
    }
    for (const auto& [without, with] : device::hidden_faults(planned)) {
      say(fmt::format("--fault {}: has no effect while {} is under way", faults[without],
                      faults[with]));
    }
    return std::visit([&](const auto& config) { return emulate(config, whole, planned); },
                      emulated.driver);
  }

 private:
  /// The simulated device behind the wire.
  struct Stand {
    Stand(const Session& whole, const HandConfig& hand, const SimulatedDeviceConfig& simulated,
          Duration watchdog, const std::vector<device::PlannedFault>& planned)
        : device(simulated, hand, clock, stream_seed(whole, whole.side(), "hand"), watchdog,
                 planned) {}
    SteadyClock clock;
    device::EmulatedDevice device;
  };
  using Faults = std::vector<device::PlannedFault>;

  [[nodiscard]] HandConfig hand_of(const Session& whole) const {
    return is_let_go ? device::beside(whole.side().hand) : whole.side().hand;
  }

  int emulate(const HaplyConfig& haply, const Session& whole, const Faults& planned) const {
    Stand stand(whole, hand_of(whole), whole.side().simulated, kEmulatedWatchdog, planned);
    device::HaplyEmulator emulator(stand.device, haply.port);
    return serve(emulator, whole, stand.device, "127.0.0.1:" + std::to_string(emulator.port()));
  }
  int emulate(const HapiConfig& hapi, const Session& whole, const Faults& planned) const {
    Stand stand(whole, hand_of(whole), whole.side().simulated, kEmulatedWatchdog, planned);
    device::HapiEmulator emulator(stand.device, hapi);
    const TerminalLink link(emulator.port(), hapi.port, "device.hapi.port",
                            "--set device.hapi.port=/tmp/NAME");
    return serve(emulator, whole, stand.device, hapi.port);
  }
  int emulate(const FalconConfig& falcon, const Session& whole, const Faults& planned) const {
    Stand stand(whole, hand_of(whole), exact(whole), kEmulatedWatchdog, planned);
    device::FalconEmulator emulator(stand.device, falcon,
                                    {.is_loaded = falcon.firmware_file.empty(), .homing = 300ms});
    return serve(emulator, whole, stand.device, falcon.port);
  }
  int emulate(const WoodenConfig& wooden, const Session& whole, const Faults& planned) const {
    Stand stand(whole, hand_of(whole), exact(whole), device::WoodenEmulator::kWatchdog, planned);
    device::WoodenEmulator emulator(stand.device, wooden);
    return serve(emulator, whole, stand.device, wooden.port);
  }
  template <class Config>
  int emulate(const Config& /*config*/, const Session& whole, const Faults& /*planned*/) const {
    throw SetupError(whole.file + ": device: there is no emulator of driver \"" +
                     device::driver_name(whole.side().driver) +
                     "\"; emulators are of haply_inverse, hapi, falcon and wooden");
  }

  /// Motors on a bus, and a hand that leads the arm to and fro. No session has such a device.
  int emulate_leader() const {
    if (!session.file.empty() || !session.overrides.empty() || !side.empty()) {
      throw SetupError(
          "--leader: the arm is not a session's device; leave SESSION, --set and "
          "--side out");
    }
    Faults planned;
    for (const std::string& fault : faults) planned.push_back(device::parse_fault(fault, bus));
    const device::JointHand hand = is_let_go ? device::JointHand() : device::leading_hand();
    const SteadyClock clock;
    if (bus == "openarm") {
      if (leader.find('/') == std::string::npos) {
        throw SetupError("--leader: \"" + leader +
                         "\" would be a CAN interface; give the emulator's socket a path, such "
                         "as /tmp/leader");
      }
      device::DamiaoEmulator emulator(
          {.motors = device::seven_damiao_motors(), .hand = hand, .faults = std::move(planned)},
          leader, "--leader", clock, 1);
      return serve_leader(emulator);
    }
    device::DynamixelEmulator emulator({.servos = device::seven_servos(),
                                        .hand = hand,
                                        .faults = std::move(planned),
                                        .bits_per_second = 0},
                                       clock, 1);
    const TerminalLink link(emulator.port(), leader, "--leader", "--leader /tmp/NAME");
    return serve_leader(emulator);
  }

  template <class Emulator>
  int serve_leader(Emulator& emulator) const {
    serve_until_stopped(
        emulator,
        RealtimeConfig{
            .priority = has_no_realtime ? 0 : 60, .cpu = -1, .wait = WaitStrategy::kBlock},
        leader);
    const double after_s = emulator.now_s() - emulator.torque_until_s();
    say(
        fmt::format("emulated leader: {} messages, least true energy {}, no torque for the last "
                    "{:.3f} s",
                    emulator.messages(), energy_text(emulator.least_energy_joule()), after_s));
    return 0;
  }

  /// The encoders of the emulated legs or motors round, not the simulated device.
  static SimulatedDeviceConfig exact(const Session& whole) {
    SimulatedDeviceConfig simulated = whole.side().simulated;
    simulated.position_resolution_m = 0.0;
    return simulated;
  }

  /// A device has a processor of its own, which no other program delays: the priority of the tick
  /// threads comes closest. On any of this computer's processors.
  [[nodiscard]] RealtimeConfig realtime_of(const Session& whole) const {
    return {.priority = has_no_realtime ? 0 : whole.side().realtime.priority,
            .cpu = -1,
            .wait = WaitStrategy::kBlock};
  }

  template <class Emulator>
  void serve_until_stopped(Emulator& emulator, const RealtimeConfig& realtime,
                           const std::string& address) const {
    const StopSignal signal;
    say("emulates the device at " + address);
    std::jthread server([&](const std::stop_token& stop) {
      say("event=realtime " + enter_realtime(realtime).text);
      emulator.run(stop);
    });
    const auto begin = std::chrono::steady_clock::now();
    while (!StopSignal::is_requested() &&
           (seconds == 0.0 ||
            std::chrono::steady_clock::now() - begin < std::chrono::duration<double>(seconds))) {
      std::this_thread::sleep_for(10ms);
    }
    server.request_stop();
    server.join();
  }

  template <class Emulator>
  int serve(Emulator& emulator, const Session& whole, device::EmulatedDevice& device,
            const std::string& address) const {
    serve_until_stopped(emulator, realtime_of(whole), address);
    const std::vector<device::FaultOutcome> outcomes = device.outcomes();
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      if (device.now_s() < outcomes[i].fault.from_s) {
        say(fmt::format("fault {}: never began, the emulator ended {:.3g} s after its start",
                        faults[i], device.now_s()));
        continue;
      }
      say(fmt::format("fault {}: {:.3f} N as it began, no force after {:.1f} ms", faults[i],
                      outcomes[i].force_newton, 1e3 * to_seconds(outcomes[i].pushed_for)));
    }
    say("emulated device: " + std::to_string(device.messages()) + " messages, least true energy " +
        energy_text(device.least_energy_joule()));
    return 0;
  }
};

}  // namespace

Command add_emulate_command(CLI::App& app) {
  return add_command<EmulateCommand>(
      app, "emulate", "stand in for the real device of a session, at the other end of its wire");
}

}  // namespace palpate
