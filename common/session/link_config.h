// link_config.h — where the nodes meet, what tcp demands, which faults are simulated on the way.
#pragma once

#include <string>

#include "common/core/clock.h"
#include "common/core/fault_line.h"

namespace palpate {

/// ZeroMQ endpoints: ipc://, tcp:// or inproc://. The node named first binds.
struct LinksConfig {
  std::string exchange;           ///< mofc ← device, hops 1 and 4
  std::string tool_motion;        ///< physics ← mofc, hop 2
  std::string interaction;        ///< physics → mofc, hop 3
  std::string device_telemetry;   ///< device → viewers, hop 5
  std::string mofc_telemetry;     ///< mofc → viewers, hop 5
  std::string physics_telemetry;  ///< physics → viewers, hop 5
  std::string hand_target;        ///< device ← viewers, hop 6
};

/// SCHED_FIFO for the tick threads; taken when permitted, reported, never required.
struct RealtimeConfig {
  int priority = 80;  ///< 1 … 99; 0: ordinary scheduling
  int cpu = 0;        ///< the one processor that device_node and mofc_node share; −1: no pinning
  WaitStrategy wait = WaitStrategy::kHybrid;
};

struct FaultsConfig {
  LinkFaults device_state;
  LinkFaults force_command;
  LinkFaults tool_motion;
  LinkFaults interaction;
};

/// What the links over tcp ask of a peer.
struct SecurityConfig {
  std::string key_folder{};   ///< as `palpate keygen` makes it; empty: no keys
  bool may_be_plain = false;  ///< without keys beyond loopback too: --insecure
};

}  // namespace palpate
