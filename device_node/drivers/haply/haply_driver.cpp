#include "device_node/drivers/haply/haply_driver.h"

#include <array>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "device_node/drivers/device_error.h"
#include "device_node/drivers/haply/haply_wire.h"
#include "device_node/drivers/motor_force.h"
#include "device_node/drivers/transport/web_socket.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kReopenLimit = 500ms;
constexpr Duration kRetry = 100ms;
constexpr std::string_view kFullFrame = R"({"session":{"force_render_full_state":{}}})";

class HaplyDevice final : public HapticDevice {
 public:
  HaplyDevice(const HaplyConfig& config, const Clock& clock, const StartUp& start_up)
      : config_(config),
        clock_(clock),
        dialect_(config.writes_values ? HaplyDialect::kValues : HaplyDialect::kVector),
        motors_(config.limits) {
    const TimePoint until = clock_.now() + start_up.limit;
    HaplySnapshot snapshot = find_service(until, start_up);
    // chosen once: a later connection asks for the same ones
    config_.device_id = snapshot.device_id;
    config_.grip_id = snapshot.grip_id;
    wait_until_ready(snapshot, until, start_up);
    warn_of_filters(snapshot, start_up);
    try_out();
    specification_ = {.model_name = "Haply Inverse3 " + snapshot.device_id,
                      .workspace_half_extent_m = config.workspace_half_extent_m,
                      .peak_force_newton = config.limits.peak_force_newton,
                      .continuous_force_newton = config.limits.continuous_force_newton,
                      .position_resolution_m = config.position_resolution_m,
                      .button_count = snapshot.grip_id.empty()    ? 0U
                                      : snapshot.is_wireless_grip ? 3U
                                                                  : 1U};
  }
  ~HaplyDevice() override { HaplyDevice::release(); }
  HaplyDevice(const HaplyDevice&) = delete;
  HaplyDevice& operator=(const HaplyDevice&) = delete;

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }

  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    return exchange(motors_.at(clock_.now()), sample);
  }

  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    if (!force_on_hand_newton.allFinite()) {
      release();
      error_ = DeviceError::kFailed;
      return false;
    }
    const Vector3 force_newton = motors_.set(force_on_hand_newton, lease, clock_.now());
    if (!exchange(force_newton, at_switch)) return false;
    at_switch.applied_force_newton = force_newton;
    return true;
  }

  void release() noexcept override {
    motors_.set(Vector3::Zero(), Duration::zero(), clock_.now());
    DeviceSample passed;
    if (socket_) static_cast<void>(exchange(Vector3::Zero(), passed));
  }

  [[nodiscard]] DeviceError last_error() const noexcept override { return error_; }

  [[nodiscard]] bool reopen() noexcept override {
    if (socket_) return true;
    try {
      static_cast<void>(connect(kReopenLimit));
      try_out();
      return true;
    } catch (const std::exception&) {
      socket_.reset();
      return false;
    }
  }

 private:
  /// The service may start together with this program.
  HaplySnapshot find_service(TimePoint until, const StartUp& start_up) {
    for (bool was_prompted = false;; was_prompted = true) {
      try {
        return connect(std::max<Duration>(until - clock_.now(), 1ms));
      } catch (const std::exception& error) {
        if (clock_.now() + kRetry >= until || start_up.stop.stop_requested()) throw;
        if (!was_prompted) start_up.prompt(std::string("waits for the service: ") + error.what());
        std::this_thread::sleep_for(kRetry);
      }
    }
  }

  HaplySnapshot connect(Duration within) {
    const TimePoint until = clock_.now() + within;
    socket_ = WebSocket::connect(config_.host, config_.port, within);
    return snapshot(until);
  }

  /// The service's next message, a full one.
  HaplySnapshot snapshot(TimePoint until) {
    std::string_view text;
    if (socket_->receive(text, until - clock_.now()) != Transfer::kDone) {
      throw std::runtime_error("the service closed the connection or said nothing");
    }
    return read_haply_snapshot(std::string(text), config_.device_id, config_.grip_id);
  }

  void wait_until_ready(HaplySnapshot& state, TimePoint until, const StartUp& start_up) {
    bool was_prompted = false;
    for (;;) {
      const bool is_powered = state.is_powered.value_or(true);
      const bool is_calibrated = state.is_calibrated.value_or(true);
      if (is_powered && is_calibrated && state.is_ready.value_or(true)) return;
      const char* const what = !is_powered      ? "connect its power supply"
                               : !is_calibrated ? "calibrate it, as its light asks for"
                                                : "it is not ready; look at the Inverse Service";
      if (!was_prompted) start_up.prompt("Inverse3 " + state.device_id + ": " + what);
      was_prompted = true;
      if (clock_.now() >= until || start_up.stop.stop_requested()) {
        throw std::runtime_error("Inverse3 " + state.device_id + " did not become ready: " + what);
      }
      std::this_thread::sleep_for(100ms);
      if (socket_->send(kFullFrame, config_.transfer_limit) != Transfer::kDone) {
        throw std::runtime_error("the service closed the connection");
      }
      state = snapshot(clock_.now() + 1s);
    }
  }

  /// The first messages allocate their buffers.
  void try_out() {
    DeviceSample passed;
    if (!exchange(Vector3::Zero(), passed)) {
      throw std::runtime_error("the service did not answer with the state of Inverse3 " +
                               config_.device_id);
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

  /// One message, one answer.
  bool exchange(const Vector3& force_newton, DeviceSample& sample) noexcept {
    if (!socket_) return fails(Transfer::kClosed);
    const std::size_t size = write_haply_force(
        config_.device_id, dialect_, config_.rotation.conjugate() * force_newton, command_);
    if (size == 0) return fails(Transfer::kCorrupt);
    Transfer transfer = socket_->send({command_.data(), size}, config_.transfer_limit);
    if (transfer != Transfer::kDone) return fails(transfer);
    std::string_view text;
    transfer = socket_->receive(text, config_.transfer_limit);
    if (transfer != Transfer::kDone) return fails(transfer);
    HaplyState state;
    if (!read_haply_state(text, config_.device_id, config_.grip_id, state)) {
      return fails(Transfer::kCorrupt);
    }
    sample = {};
    sample.sampled_at = clock_.now();
    sample.hand_position_m = config_.rotation * (*state.cursor_position_m - config_.origin_m);
    if (state.orientation) orientation_ = config_.rotation * *state.orientation;
    if (state.buttons) buttons_ = *state.buttons;
    sample.orientation = orientation_;
    sample.buttons = buttons_;
    error_ = DeviceError::kNone;
    return true;
  }

  /// A message without its answer: which answer belongs to which message is lost, and so is the
  /// connection.
  bool fails(Transfer transfer) noexcept {
    error_ = device_error(transfer);
    socket_.reset();
    return false;
  }

  HaplyConfig config_;
  const Clock& clock_;
  HaplyDialect dialect_;
  MotorForce motors_;
  DeviceSpecification specification_;
  std::unique_ptr<WebSocket> socket_;
  std::array<char, kHaplyCommandBytes> command_{};
  Quaternion orientation_ = Quaternion::Identity();
  std::uint32_t buttons_ = 0;
  DeviceError error_ = DeviceError::kNone;
};

}  // namespace

std::unique_ptr<HapticDevice> open_haply(const HaplyConfig& config, const Clock& clock,
                                         const StartUp& start_up) {
  try {
    return std::make_unique<HaplyDevice>(config, clock, start_up);
  } catch (const SetupError&) {
    throw;
  } catch (const std::exception& error) {
    throw SetupError(std::string("device.haply_inverse: ") + error.what() +
                     "; is the Inverse Service running, and host and port its own? `palpate "
                     "emulate` stands in for it");
  }
}

}  // namespace palpate::device
