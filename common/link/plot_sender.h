// plot_sender.h — palpate.v1.Telemetry for PlotJuggler's "ZMQ Subscriber": one message per device
// tick, two parts, topic and protobuf. Load proto/palpate/v1/plot.proto there.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/telemetry/telemetry.h"
#include "common/link/zmq_links.h"

namespace palpate {

inline constexpr const char* kPlotTopic = "palpate";
/// Where PlotJuggler looks unless it is told otherwise.
inline constexpr const char* kPlotEndpoint = "tcp://127.0.0.1:9872";

class PlotSender {
 public:
  /// Binds. Throws SetupError; also for an endpoint that other machines could reach: there is no
  /// encryption and no token on this port. @param option  for messages
  PlotSender(ZmqContext& context, const std::string& endpoint, const std::string& option);

  /// Never blocks; a slow reader misses ticks. @param at_ns  of the tick, since 1970
  void send(std::uint64_t at_ns, const DeviceTick& device, const std::optional<MofcTick>& mofc,
            double transparency) noexcept;
  /// With the real port where "*" was asked for.
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
};

}  // namespace palpate
