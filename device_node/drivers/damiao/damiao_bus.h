// SPDX-License-Identifier: Apache-2.0
// damiao_bus.h — frames to the motors of one CAN bus and their answers, all within a given time.
// One thread; nothing allocates after the construction, nothing throws.
#pragma once

#include <bitset>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/time.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/drivers/leader/leader.h"
#include "device_node/drivers/transport/can_port.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// Where a motor hears and where it is heard.
struct DamiaoAddress {
  unsigned id = 0;           ///< of frames to it
  unsigned feedback_id = 0;  ///< of frames that it sends
};

class DamiaoBus {
 public:
  using Answered = std::bitset<kMostLeaderJoints>;

  /// @param answer_limit  for all answers to what is sent at once, sending included
  /// @throws std::runtime_error  why the port cannot be opened
  DamiaoBus(const std::string& port, bool is_fd, Duration answer_limit)
      : port_(port, is_fd), is_fd_(is_fd), answer_limit_(answer_limit) {}

  /// One frame to each motor, then the feedback of each.
  /// @param answered  receives who has answered
  /// @return kDone: all have
  [[nodiscard]] Transfer exchange(std::span<const CanFrame> frames,
                                  std::span<const DamiaoAddress> motors,
                                  std::span<DamiaoFeedback> answers, Answered& answered) noexcept;
  [[nodiscard]] Transfer command(const DamiaoAddress& motor, DamiaoCommand command,
                                 DamiaoFeedback& answer) noexcept;
  [[nodiscard]] Transfer refresh(const DamiaoAddress& motor, DamiaoFeedback& answer) noexcept;
  [[nodiscard]] Transfer read_register(const DamiaoAddress& motor, std::uint8_t which,
                                       std::uint32_t& value) noexcept;
  /// @return kCorrupt: it answers that it has another value now
  [[nodiscard]] Transfer write_register(const DamiaoAddress& motor, std::uint8_t which,
                                        std::uint32_t value) noexcept;
  /// No answer is waited for.
  [[nodiscard]] Transfer send(CanFrame frame) noexcept;

 private:
  [[nodiscard]] Transfer ask_register(const CanFrame& frame, const DamiaoAddress& motor,
                                      std::uint8_t which, std::uint32_t& value) noexcept;

  CanPort port_;
  bool is_fd_;
  Duration answer_limit_;
};

}  // namespace palpate::device
