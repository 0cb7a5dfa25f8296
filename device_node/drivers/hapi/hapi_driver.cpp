// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/hapi/hapi_driver.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <utility>

#include "device_node/drivers/held_torque.h"
#include "device_node/drivers/transport/serial_port.h"
#include "device_node/drivers/wire_device.h"

namespace palpate::device {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

/// The axis across the plane has no motor.
std::optional<Matrix3> hapi_jacobian(const Pantograph& links,
                                     const std::optional<Vector2>& angles_rad) {
  const std::optional<Matrix2> of_plane = angles_rad ? links.jacobian(*angles_rad) : std::nullopt;
  if (!of_plane) return {};
  Matrix3 jacobian = Matrix3::Identity();
  jacobian.topLeftCorner<2, 2>() = *of_plane;
  return jacobian;
}

class HapiDevice final : public WireDevice {
 public:
  HapiDevice(const HapiConfig& config, const Clock& clock, const StartUp& start_up)
      : WireDevice(config.limits, clock),
        config_(config),
        board_(hapi_board(config)),
        links_(pantograph_geometry(config)) {
    DeviceSpecification specification = specified("hAPI pantograph", config);
    const Matrix3 rotation = config.rotation.toRotationMatrix();
    specification.force_axes = rotation * Vector3(1, 1, 0).asDiagonal() * rotation.transpose();
    std::array<char, 160> text{};
    std::snprintf(
        text.data(), text.size(),
        "hold the handle at its home position, the left arm at %g and the right arm at %g "
        "degrees: the board takes the place where it is for that",
        config.encoder_offsets_deg[0], config.encoder_offsets_deg[1]);
    specification.calibration = text.data();
    specification.answers_uncalibrated = false;
    const double count_rad = 2.0 * std::numbers::pi / config.encoder_resolution;
    bound_held_force(specification, config, {count_rad, count_rad, 0.0},
                     [this](const Vector3& handle_m) {
                       return hapi_jacobian(links_, links_.angles_rad(handle_m.head<2>()));
                     });
    set_specification(std::move(specification));
    connect_within(start_up, "the board");
  }
  ~HapiDevice() override { release_finally(); }
  HapiDevice(const HapiDevice&) = delete;
  HapiDevice& operator=(const HapiDevice&) = delete;

 private:
  void connect(Duration /*within*/) override {
    port_.emplace(config_.port);
    angles_rad_.reset();
  }
  /// The set-up makes the present angles those of the home position, so it is sent here only.
  [[nodiscard]] bool take_calibration() override {
    angles_rad_.reset();
    const auto set_up = hapi_set_up(board_);
    sent(std::as_bytes(std::span(set_up)));
    DeviceSample passed;
    return port_->write(set_up, config_.transfer_limit) == Transfer::kDone &&
           release_once() == Transfer::kDone &&
           exchange(Vector3::Zero(), passed) == Transfer::kDone;
  }
  [[nodiscard]] bool is_connected() const noexcept override { return port_.has_value(); }
  void disconnect() noexcept override { port_.reset(); }

  /// The part of a force in the plane of the links, in their frame.
  [[nodiscard]] Vector2 in_plane(const Vector3& force_newton) const noexcept {
    return (config_.rotation.conjugate() * force_newton).head<2>();
  }

  /// @param torques  receives what the board is sent: whole steps, scaled to the largest torque
  /// @return         the force that these make, in the plane of the links [N]
  Vector2 torques_for(const Vector2& force_newton,
                      std::array<float, kHapiMotors>& torques) const noexcept {
    // torques by the angles of the last answer: a period old
    const std::optional<Matrix2> jacobian =
        angles_rad_ ? links_.jacobian(*angles_rad_) : std::optional<Matrix2>();
    if (!jacobian) return Vector2::Zero();
    const double step = config_.torque_step_newton_m;
    const double steps_per_newton_m = config_.torque_gain / step;
    Vector3 steps = Vector3::Zero();  // the third motor is none
    steps.head<2>() = steps_per_newton_m * jacobian->transpose() * force_newton;
    scale_counts(steps, std::floor(config_.largest_torque_newton_m / step));
    Matrix3 newton_per_step = Matrix3::Zero();
    newton_per_step.topLeftCorner<2, 2>() = jacobian->transpose().inverse() / steps_per_newton_m;
    const Vector3 made_newton = round_counts(steps, newton_per_step, allowed_newton());
    for (std::size_t i = 0; i < kHapiMotors; ++i) {
      torques[i] = static_cast<float>(step * steps[static_cast<Eigen::Index>(i)]);
    }
    return made_newton.head<2>();
  }

  Transfer exchange(const Vector3& requested_newton, DeviceSample& sample) noexcept override {
    if (!port_) return Transfer::kClosed;
    // an answer too many: each would be that of an earlier message
    if (angles_rad_ && port_->has_input()) return Transfer::kCorrupt;
    std::array<float, kHapiMotors> torques{};
    const Vector2 applied_newton = torques_for(in_plane(requested_newton), torques);
    std::array<float, kHapiMotors> angles_deg{};
    const Transfer transfer = ask(torques, angles_deg);
    if (transfer != Transfer::kDone) return transfer;
    const Vector2 angles_rad(kRadPerDeg * angles_deg[0], kRadPerDeg * angles_deg[1]);
    const std::optional<Vector2> handle_m = links_.handle_m(angles_rad);
    if (!handle_m) return Transfer::kCorrupt;  // rods that cannot meet

    angles_rad_ = angles_rad;
    sample.hand_position_m =
        config_.rotation * (Vector3(handle_m->x(), handle_m->y(), 0.0) - config_.origin_m);
    sample.applied_force_newton =
        config_.rotation * Vector3(applied_newton.x(), applied_newton.y(), 0.0);
    held_.answered(Vector3(torques[0], torques[1], 0.0) / config_.torque_gain,
                   Vector3(angles_rad.x(), angles_rad.y(), 0.0),
                   mounted(config_, hapi_jacobian(links_, angles_rad)), sample);
    return Transfer::kDone;
  }

  Transfer release_once() noexcept override {
    held_.forget();
    std::array<float, kHapiMotors> passed{};
    return ask({}, passed);
  }

  Transfer ask(const std::array<float, kHapiMotors>& torques,
               std::array<float, kHapiMotors>& angles_deg) noexcept {
    if (!port_) return Transfer::kClosed;
    port_->discard_input();
    const auto command = hapi_torques(board_.device_id, torques);
    sent(std::as_bytes(std::span(command)));
    Transfer transfer = port_->write(command, config_.transfer_limit);
    if (transfer != Transfer::kDone) return transfer;
    std::array<std::byte, kHapiReadingBytes> answer{};
    transfer = port_->read(answer, config_.transfer_limit);
    received(transfer, answer);
    if (transfer != Transfer::kDone) return transfer;
    // more than one answer: this is that of an earlier message
    if (port_->has_input() || !read_hapi_angles(answer, board_.device_id, angles_deg)) {
      return Transfer::kCorrupt;
    }
    return Transfer::kDone;
  }

  HapiConfig config_;
  HapiBoard board_;
  Pantograph links_;
  std::optional<SerialPort> port_;
  std::optional<Vector2> angles_rad_;
  HeldTorque held_;
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
  return open_wire_device<HapiDevice>(
      "device.hapi",
      "is it the board's serial port, and may you use it? `palpate devices` lists the ports",
      config, clock, start_up);
}

}  // namespace palpate::device
