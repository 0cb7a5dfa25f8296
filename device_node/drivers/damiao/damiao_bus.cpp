// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/damiao/damiao_bus.h"

#include <algorithm>
#include <chrono>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

Duration left_until(WireClock::time_point deadline) {
  return std::max(Duration::zero(),
                  std::chrono::duration_cast<Duration>(deadline - WireClock::now()));
}

}  // namespace

Transfer DamiaoBus::send(CanFrame frame) noexcept {
  frame.is_fd = is_fd_;
  return port_.send(frame, answer_limit_);
}

Transfer DamiaoBus::exchange(std::span<const CanFrame> frames,
                             std::span<const DamiaoAddress> motors,
                             std::span<DamiaoFeedback> answers, Answered& answered) noexcept {
  answered.reset();
  port_.discard();  // answers to earlier frames that came too late
  const WireClock::time_point deadline = wire_deadline(answer_limit_);
  for (CanFrame frame : frames) {
    frame.is_fd = is_fd_;
    const Transfer transfer = port_.send(frame, left_until(deadline));
    if (transfer != Transfer::kDone) return transfer;
  }
  bool is_corrupt = false;
  while (answered.count() < motors.size()) {
    CanFrame frame;
    const Transfer transfer = port_.receive(frame, left_until(deadline));
    if (transfer == Transfer::kTimeout && is_corrupt) return Transfer::kCorrupt;
    if (transfer != Transfer::kDone) return transfer;
    for (std::size_t i = 0; i < motors.size(); ++i) {
      if (frame.id != motors[i].feedback_id || answered[i]) continue;
      answered[i] = read_damiao_feedback(frame, motors[i].id, answers[i]);
      is_corrupt = is_corrupt || !answered[i];
    }
    if (WireClock::now() >= deadline && answered.count() < motors.size()) {
      return is_corrupt ? Transfer::kCorrupt : Transfer::kTimeout;
    }
  }
  return Transfer::kDone;
}

Transfer DamiaoBus::command(const DamiaoAddress& motor, DamiaoCommand command,
                            DamiaoFeedback& answer) noexcept {
  const CanFrame frame = damiao_command(motor.id, command);
  Answered passed;
  return exchange({&frame, 1}, {&motor, 1}, {&answer, 1}, passed);
}

Transfer DamiaoBus::refresh(const DamiaoAddress& motor, DamiaoFeedback& answer) noexcept {
  const CanFrame frame = damiao_refresh(motor.id);
  Answered passed;
  return exchange({&frame, 1}, {&motor, 1}, {&answer, 1}, passed);
}

Transfer DamiaoBus::ask_register(const CanFrame& frame, const DamiaoAddress& motor,
                                 std::uint8_t which, std::uint32_t& value) noexcept {
  port_.discard();
  const WireClock::time_point deadline = wire_deadline(answer_limit_);
  Transfer transfer = send(frame);
  while (transfer == Transfer::kDone) {
    CanFrame answer;
    transfer = port_.receive(answer, left_until(deadline));
    if (transfer != Transfer::kDone) break;
    if (answer.id == motor.feedback_id && read_damiao_register(answer, motor.id, which, value)) {
      return Transfer::kDone;
    }
    if (WireClock::now() >= deadline) return Transfer::kTimeout;
  }
  return transfer;
}

Transfer DamiaoBus::read_register(const DamiaoAddress& motor, std::uint8_t which,
                                  std::uint32_t& value) noexcept {
  return ask_register(damiao_read_register(motor.id, which), motor, which, value);
}

Transfer DamiaoBus::write_register(const DamiaoAddress& motor, std::uint8_t which,
                                   std::uint32_t value) noexcept {
  std::uint32_t answer = 0;
  const Transfer transfer =
      ask_register(damiao_write_register(motor.id, which, value), motor, which, answer);
  return transfer == Transfer::kDone && answer != value ? Transfer::kCorrupt : transfer;
}

}  // namespace palpate::device
