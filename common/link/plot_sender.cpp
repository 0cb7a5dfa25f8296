#include "common/link/plot_sender.h"

#include <cstring>

#include "common/core/check.h"
#include "common/link/viewer_codec.h"

namespace palpate {
namespace {

constexpr int kQueuedTicks = 4000;

Attachment on_this_machine(const std::string& endpoint, const std::string& option) {
  Attachment attachment = bind_to(endpoint, option);
  const Scheme scheme = scheme_of(attachment);
  if (scheme == Scheme::kIpc || (scheme == Scheme::kTcp && is_on_loopback(attachment))) {
    return attachment;
  }
  throw SetupError(option + " " + endpoint +
                   ": this port is not protected; give one of this machine, such as " +
                   kPlotEndpoint);
}

}  // namespace

PlotSender::PlotSender(ZmqContext& context, const std::string& endpoint, const std::string& option)
    : socket_(context, {.type = zmq::socket_type::pub, .send_queue = kQueuedTicks},
              {on_this_machine(endpoint, option)}) {}

void PlotSender::send(std::uint64_t at_ns, const DeviceTick& device,
                      const std::optional<MofcTick>& mofc, double transparency) noexcept {
  const std::string bytes = encode_telemetry(at_ns, device, mofc, transparency);
  zmq::message_t topic(kPlotTopic, std::strlen(kPlotTopic));
  zmq::message_t payload(bytes.data(), bytes.size());
  // both or none: a publisher drops whole messages
  if (socket_.send(topic, ZMQ_SNDMORE) == SendResult::kSent) {
    static_cast<void>(socket_.send(payload, 0));
  }
}

}  // namespace palpate
