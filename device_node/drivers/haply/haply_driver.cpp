// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/haply/haply_driver.h"

#include <array>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>

#include "device_node/drivers/haply/haply_wire.h"
#include "device_node/drivers/transport/web_socket.h"
#include "device_node/drivers/wire_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// A hand trembles: a grip whose orientation is the same to the last digit for so long is lost, and
/// the service repeats its last state.
constexpr Duration kGripStale = 250ms;

constexpr const char* kMakeReady =
    "connect the power supply of the Inverse3, calibrate it as its light asks for, and see that "
    "the "
    "Inverse Service shows it as ready and without a transform";

constexpr std::string_view kFullFrame = R"({"session":{"force_render_full_state":{}}})";

class HaplyDevice final : public WireDevice {
 public:
  HaplyDevice(const HaplyConfig& config, const Clock& clock, const StartUp& start_up)
      : WireDevice(config.limits, clock),
        config_(config),
        dialect_(config.writes_values ? HaplyDialect::kValues : HaplyDialect::kVector) {
    const TimePoint until = clock.now() + start_up.limit;
    connect_within(start_up, "the service");
    // chosen once: a later connection asks for the same ones
    config_.device_id = snapshot_.device_id;
    config_.grip_id = snapshot_.grip_id;
    wait_until_ready(snapshot_, until, start_up);
    warn_of_filters(snapshot_, start_up);
    // the first messages allocate their buffers
    DeviceSample passed;
    if (exchange(Vector3::Zero(), passed) != Transfer::kDone) {
      throw std::runtime_error("the service did not answer with the state of Inverse3 " +
                               config_.device_id);
    }
    DeviceSpecification specification = specified("Haply Inverse3 " + config_.device_id, config);
    if (!config_.grip_id.empty()) specification.button_count = snapshot_.is_wireless_grip ? 3 : 1;
    specification.calibration = kMakeReady;
    set_specification(std::move(specification));
    set_calibrated();
  }
  ~HaplyDevice() override { release_finally(); }
  HaplyDevice(const HaplyDevice&) = delete;
  HaplyDevice& operator=(const HaplyDevice&) = delete;

 private:
  void connect(Duration within) override {
    const TimePoint until = clock().now() + within;
    socket_ = WebSocket::connect(config_.host, config_.port, within);
    snapshot_ = snapshot(until);
  }
  [[nodiscard]] bool is_connected() const noexcept override { return socket_ != nullptr; }
  void disconnect() noexcept override { socket_.reset(); }

  /// The service's next message, a full one.
  HaplySnapshot snapshot(TimePoint until) {
    std::string_view text;
    if (socket_->receive(text, until - clock().now()) != Transfer::kDone) {
      throw std::runtime_error("the service closed the connection or said nothing");
    }
    return read_haply_snapshot(std::string(text), config_.device_id, config_.grip_id, dialect_);
  }

  [[nodiscard]] bool knows_its_calibration() override {
    if (socket_->send(kFullFrame, config_.transfer_limit) != Transfer::kDone) {
      throw std::runtime_error("the service closed the connection");
    }
    snapshot_ = snapshot(clock().now() + 1s);
    DeviceSample passed;
    return lack(snapshot_) == nullptr && exchange(Vector3::Zero(), passed) == Transfer::kDone;
  }

  /// What the device needs before it can be used; null: nothing.
  static const char* lack(const HaplySnapshot& state) {
    if (!state.is_powered.value_or(true)) return "connect its power supply";
    if (!state.is_calibrated.value_or(true)) return "calibrate it, as its light asks for";
    if (!state.is_ready.value_or(true)) return "it is not ready; look at the Inverse Service";
    return nullptr;
  }

  void wait_until_ready(HaplySnapshot& state, TimePoint until, const StartUp& start_up) {
    bool was_prompted = false;
    for (;;) {
      const char* const what = lack(state);
      if (what == nullptr) return;
      if (!was_prompted) start_up.prompt("Inverse3 " + state.device_id + ": " + what);
      was_prompted = true;
      if (clock().now() >= until || start_up.stop.stop_requested()) {
        throw std::runtime_error("Inverse3 " + state.device_id + " did not become ready: " + what);
      }
      std::this_thread::sleep_for(100ms);
      if (socket_->send(kFullFrame, config_.transfer_limit) != Transfer::kDone) {
        throw std::runtime_error("the service closed the connection");
      }
      state = snapshot(clock().now() + 1s);
    }
  }

  static void warn_of_filters(const HaplySnapshot& snapshot, const StartUp& start_up) {
    if (snapshot.force_gate_gain != 0.0 || snapshot.damping != 0.0) {
      start_up.prompt(
          "the Inverse Service changes forces itself (force gate " +
          std::to_string(snapshot.force_gate_gain) + ", damping " +
          std::to_string(snapshot.damping) +
          "): turn both off for a true force. They must not be counted as friction of the device");
    }
  }

  /// A message without its answer: which answer belongs to which message is lost, and so is the
  /// connection.
  Transfer exchange(const Vector3& force_newton, DeviceSample& sample) noexcept override {
    HaplyState state;
    const Transfer outcome = ask(force_newton, state);
    if (outcome != Transfer::kDone) {
      socket_.reset();
      return outcome;
    }
    if (!is_ready(state)) return Transfer::kNotReady;
    sample.hand_position_m = config_.rotation * (*state.cursor_position_m - config_.origin_m);
    if (state.orientation) orientation_ = config_.rotation * *state.orientation;
    sample.orientation = orientation_;
    sample.buttons = held_buttons(state);
    sample.applied_force_newton = force_newton;
    if (state.cursor_force_newton) {
      sample.measured_newton = config_.rotation * *state.cursor_force_newton;
    }
    return Transfer::kDone;
  }

  /// A grip that is not in the answer, is not connected or stands perfectly still holds no button,
  /// until all of them were seen released.
  std::uint32_t held_buttons(const HaplyState& state) noexcept {
    const TimePoint now = clock().now();
    if (state.orientation && state.orientation->coeffs() != grip_orientation_.coeffs()) {
      grip_orientation_ = *state.orientation;
      grip_moved_at_ = now;
    }
    const bool is_alive = state.buttons && state.is_grip_connected.value_or(true) &&
                          now - grip_moved_at_ <= kGripStale;
    if (!is_alive) {
      must_let_go_ = true;
    } else if (*state.buttons == 0) {
      must_let_go_ = false;
    }
    return must_let_go_ ? 0 : *state.buttons;
  }

  Transfer release_once() noexcept override {
    HaplyState state;
    const Transfer outcome = ask(Vector3::Zero(), state);
    if (outcome != Transfer::kDone) socket_.reset();
    return outcome;
  }

  Transfer ask(const Vector3& force_newton, HaplyState& state) noexcept {
    if (!socket_) return Transfer::kClosed;
    const std::size_t size = write_haply_force(
        config_.device_id, dialect_, config_.rotation.conjugate() * force_newton, command_);
    if (size == 0) return Transfer::kCorrupt;
    // an answer too many: from now on each would be that of an earlier message
    if (socket_->has_message()) return Transfer::kCorrupt;
    sent(std::as_bytes(std::span(command_.data(), size)));
    Transfer transfer = socket_->send({command_.data(), size}, config_.transfer_limit);
    if (transfer != Transfer::kDone) return transfer;
    std::string_view text;
    transfer = socket_->receive(text, config_.transfer_limit);
    received(transfer, std::as_bytes(std::span(text)));
    if (transfer != Transfer::kDone) return transfer;
    if (!read_haply_state(text, config_.device_id, config_.grip_id, state)) {
      return state.is_gone ? Transfer::kClosed : Transfer::kCorrupt;
    }
    return Transfer::kDone;
  }

  static bool is_ready(const HaplyState& state) noexcept {
    return state.is_powered.value_or(true) && state.is_calibrated.value_or(true) &&
           state.is_ready.value_or(true) && !state.is_transformed;
  }

  HaplyConfig config_;
  HaplyDialect dialect_;
  HaplySnapshot snapshot_;
  std::unique_ptr<WebSocket> socket_;
  std::array<char, kHaplyCommandBytes> command_{};
  Quaternion orientation_ = Quaternion::Identity();
  Quaternion grip_orientation_ = Quaternion::Identity();  // as the service gives it
  TimePoint grip_moved_at_{};
  bool must_let_go_ = true;
};

}  // namespace

std::unique_ptr<HapticDevice> open_haply(const HaplyConfig& config, const Clock& clock,
                                         const StartUp& start_up) {
  return open_wire_device<HaplyDevice>("device.haply_inverse",
                                       "is the Inverse Service running, and host and port its own? "
                                       "`palpate emulate` stands in for it",
                                       config, clock, start_up);
}

}  // namespace palpate::device
