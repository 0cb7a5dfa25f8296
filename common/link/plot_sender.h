// SPDX-License-Identifier: Apache-2.0
// plot_sender.h — publishes palpate.v1.Telemetry for PlotJuggler's "ZMQ Subscriber": one message
// per device tick with two parts, topic and protobuf. PlotJuggler loads
// proto/palpate/v1/plot.proto.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/link/socket/link_socket.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

inline constexpr const char* kPlotTopic = "palpate";
/// PlotJuggler's default.
inline constexpr const char* kPlotEndpoint = "tcp://127.0.0.1:9872";

class PlotSender {
 public:
  /// Binds. Throws SetupError; also if other machines could reach the endpoint, because this port
  /// has neither encryption nor a token. @param option  for error messages
  PlotSender(ZmqContext& context, const std::string& endpoint, const std::string& option);

  /// Never blocks; a slow reader misses ticks. @param at_ns  time of the tick since 1970
  void send(std::uint64_t at_ns, const DeviceTick& device, const std::optional<MofcTick>& mofc,
            double transparency) noexcept;
  /// With the actual port instead of "*".
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
};

}  // namespace palpate
