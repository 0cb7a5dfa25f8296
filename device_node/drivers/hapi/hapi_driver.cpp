#include "device_node/drivers/hapi/hapi_driver.h"

#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>

#include "common/core/check.h"
#include "device_node/drivers/device_error.h"
#include "device_node/drivers/motor_force.h"
#include "device_node/drivers/transport/serial_port.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRetry = 100ms;
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

class HapiDevice final : public HapticDevice {
 public:
  HapiDevice(const HapiConfig& config, const Clock& clock, const StartUp& start_up)
      : config_(config),
        board_(hapi_board(config)),
        clock_(clock),
        links_(pantograph_geometry(config)),
        motors_(config.limits),
        specification_{.model_name = "hAPI pantograph",
                       .workspace_half_extent_m = config.workspace_half_extent_m,
                       .peak_force_newton = config.limits.peak_force_newton,
                       .continuous_force_newton = config.limits.continuous_force_newton,
                       .position_resolution_m = config.position_resolution_m,
                       .force_axes = config.rotation.toRotationMatrix() *
                                     Vector3(1, 1, 0).asDiagonal() *
                                     config.rotation.toRotationMatrix().transpose()} {
    // the board may be plugged in while this program starts
    const TimePoint until = clock_.now() + start_up.limit;
    for (bool was_prompted = false;; was_prompted = true) {
      std::string why = config.port + ": the board does not answer";
      try {
        connect();
        DeviceSample passed;
        if (exchange(Vector2::Zero(), passed)) return;
      } catch (const std::exception& error) {
        why = error.what();
      }
      if (clock_.now() + kRetry >= until || start_up.stop.stop_requested()) {
        throw std::runtime_error(why);
      }
      if (!was_prompted) start_up.prompt("waits for the board: " + why);
      std::this_thread::sleep_for(kRetry);
    }
  }
  ~HapiDevice() override { HapiDevice::release(); }
  HapiDevice(const HapiDevice&) = delete;
  HapiDevice& operator=(const HapiDevice&) = delete;

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }

  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    return exchange(in_plane(motors_.at(clock_.now())), sample);
  }

  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    if (!force_on_hand_newton.allFinite()) {
      release();
      error_ = DeviceError::kFailed;
      return false;
    }
    return exchange(in_plane(motors_.set(force_on_hand_newton, lease, clock_.now())), at_switch);
  }

  void release() noexcept override {
    motors_.set(Vector3::Zero(), Duration::zero(), clock_.now());
    DeviceSample passed;
    if (port_) static_cast<void>(exchange(Vector2::Zero(), passed));
  }

  [[nodiscard]] DeviceError last_error() const noexcept override { return error_; }

  [[nodiscard]] bool reopen() noexcept override {
    try {
      connect();
      DeviceSample passed;
      return exchange(Vector2::Zero(), passed);
    } catch (const std::exception&) {
      port_.reset();
      return false;
    }
  }

 private:
  void connect() {
    port_.emplace(config_.port);
    angles_rad_.reset();
    if (port_->write(hapi_set_up(board_), 500ms) != Transfer::kDone) {
      throw std::runtime_error(config_.port + ": cannot be written to");
    }
  }

  /// The part of a force in the plane of the links, in their frame.
  [[nodiscard]] Vector2 in_plane(const Vector3& force_newton) const noexcept {
    return (config_.rotation.conjugate() * force_newton).head<2>();
  }

  /// One message, one answer.
  bool exchange(const Vector2& force_newton, DeviceSample& sample) noexcept {
    if (!port_) return fails(Transfer::kClosed);
    // torques by the angles of the last answer: a period old
    const std::optional<Matrix2> jacobian =
        angles_rad_ ? links_.jacobian(*angles_rad_) : std::optional<Matrix2>();
    std::array<float, kHapiMotors> torques{};
    Vector2 applied_newton = Vector2::Zero();
    if (jacobian) {
      const Vector2 torque_newton_m = jacobian->transpose() * force_newton;
      for (std::size_t i = 0; i < kHapiMotors; ++i) {
        torques[i] =
            static_cast<float>(config_.torque_gain * torque_newton_m[static_cast<Eigen::Index>(i)]);
      }
      applied_newton = force_newton;
    }
    port_->discard_input();
    Transfer transfer =
        port_->write(hapi_torques(board_.device_id, torques), config_.transfer_limit);
    if (transfer != Transfer::kDone) return fails(transfer);
    std::array<std::byte, kHapiReadingBytes> answer{};
    transfer = port_->read(answer, config_.transfer_limit);
    if (transfer != Transfer::kDone) return fails(transfer);
    std::array<float, kHapiMotors> angles_deg{};
    if (!read_hapi_angles(answer, board_.device_id, angles_deg)) return fails(Transfer::kCorrupt);
    const Vector2 angles_rad(kRadPerDeg * angles_deg[0], kRadPerDeg * angles_deg[1]);
    const std::optional<Vector2> handle_m = links_.handle_m(angles_rad);
    if (!handle_m) return fails(Transfer::kCorrupt);  // rods that cannot meet

    angles_rad_ = angles_rad;
    sample = {};
    sample.sampled_at = clock_.now();
    sample.hand_position_m =
        config_.rotation * (Vector3(handle_m->x(), handle_m->y(), 0.0) - config_.origin_m);
    sample.applied_force_newton =
        config_.rotation * Vector3(applied_newton.x(), applied_newton.y(), 0.0);
    error_ = DeviceError::kNone;
    return true;
  }

  bool fails(Transfer transfer) noexcept {
    error_ = device_error(transfer);
    if (transfer == Transfer::kClosed) port_.reset();
    return false;
  }

  HapiConfig config_;
  HapiBoard board_;
  const Clock& clock_;
  Pantograph links_;
  MotorForce motors_;
  DeviceSpecification specification_;
  std::optional<SerialPort> port_;
  std::optional<Vector2> angles_rad_;
  DeviceError error_ = DeviceError::kNone;
};

}  // namespace

HapiBoard hapi_board(const HapiConfig& config) {
  HapiBoard board;
  board.device_id = static_cast<std::uint8_t>(config.device_id);
  for (std::size_t i = 0; i < kHapiMotors; ++i) {
    board.motor_ports[i] = static_cast<std::uint8_t>(config.motor_ports[i]);
    board.motor_directions[i] = config.are_motors_reversed[i] ? 1 : 0;
    board.encoder_ports[i] = static_cast<std::uint8_t>(config.encoder_ports[i]);
    board.encoder_directions[i] = config.are_encoders_reversed[i] ? 1 : 0;
    board.encoder_offsets_deg[i] = static_cast<float>(config.encoder_offsets_deg[i]);
    board.encoder_resolutions[i] = static_cast<float>(config.encoder_resolution);
  }
  return board;
}

PantographGeometry pantograph_geometry(const HapiConfig& config) {
  return {.arm_m = config.arm_m, .rod_m = config.rod_m, .base_m = config.base_m};
}

std::unique_ptr<HapticDevice> open_hapi(const HapiConfig& config, const Clock& clock,
                                        const StartUp& start_up) {
  try {
    return std::make_unique<HapiDevice>(config, clock, start_up);
  } catch (const std::exception& error) {
    throw SetupError(std::string("device.hapi: ") + error.what() +
                     "; is it the board's serial port, and may you use it? `palpate devices` lists "
                     "the ports");
  }
}

}  // namespace palpate::device
