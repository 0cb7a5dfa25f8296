// SPDX-License-Identifier: Apache-2.0
// link_config.h — endpoints, real-time settings, simulated network faults, tcp security.
#pragma once

#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/fault_line.h"

namespace palpate {

/// ZeroMQ endpoints of one side: ipc://, tcp:// or inproc://.
struct LinksConfig {
  std::string exchange;          ///< mofc ← device, hops 1 and 4
  std::string tool_motion;       ///< physics ← mofc, hop 2
  std::string interaction;       ///< physics → mofc, hop 3
  std::string device_telemetry;  ///< device → viewers, hop 5
  std::string mofc_telemetry;    ///< mofc → viewers, hop 5
  std::string hand_target;       ///< device ← viewers, hop 6
  /// device ← viewers, hop 9; always an ipc file, used only with viewer.has_control
  std::string acknowledgement{};
  std::string standby_tool_motion{};  ///< of physics.standby, hop 2; empty without
  std::string standby_interaction{};  ///< of physics.standby, hop 3; empty without
};

/// SCHED_FIFO for the tick threads: used where permitted, reported, never required.
struct RealtimeConfig {
  int priority = 80;  ///< 1 … 99; 0: ordinary scheduling
  int cpu = 0;        ///< the processor that device_node and mofc_node share; −1: no pinning
  WaitStrategy wait = WaitStrategy::kHybrid;
};

/// The process of the device is not run in time.
struct DeviceFaults {
  std::vector<FaultWindow> skips{};  ///< a tick that is due in one begins at its end
  double late_ratio = 0.0;           ///< of the ticks: 1 … `late_periods` periods late
  double late_periods = 5.0;
  double late_switch_ratio = 0.0;  ///< of the switches: up to `late_switch` after their decision
  Duration late_switch{};
};

struct FaultsConfig {
  LinkFaults device_state;
  LinkFaults force_command;
  LinkFaults tool_motion;
  LinkFaults interaction;
  LinkFaults standby_tool_motion{};
  LinkFaults standby_interaction{};
  DeviceFaults device;
};

/// How links over tcp authenticate their peers.
struct SecurityConfig {
  std::string key_folder{};   ///< written by `palpate keygen`; empty: no keys
  bool may_be_plain = false;  ///< --insecure: no keys needed beyond loopback
};

}  // namespace palpate
