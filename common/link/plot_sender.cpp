// SPDX-License-Identifier: Apache-2.0
#include "common/link/plot_sender.h"

#include <cstring>

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate {
namespace {

Attachment on_this_machine(const std::string& endpoint, const std::string& option) {
  Attachment attachment = bind_to(endpoint, option);
  const Scheme scheme = scheme_of(attachment);
  if (scheme == Scheme::kIpc || (scheme == Scheme::kTcp && is_on_loopback(attachment))) {
    return attachment;
  }
  throw SetupError(option + " " + endpoint +
                   ": this port has no access control; give one on this machine, such as " +
                   kPlotEndpoint);
}

}  // namespace

PlotSender::PlotSender(ZmqContext& context, const std::string& endpoint, const std::string& option)
    : socket_(context, kPlotSender, on_this_machine(endpoint, option)) {}

void PlotSender::send(std::uint64_t at_ns, const DeviceTick& device,
                      const std::optional<MofcTick>& mofc, double transparency) noexcept {
  const std::string bytes = encode_telemetry(at_ns, device, mofc, transparency);
  zmq::message_t topic(kPlotTopic, std::strlen(kPlotTopic));
  zmq::message_t payload(bytes.data(), bytes.size());
  // a publisher drops whole messages, never one part
  if (socket_.send(topic, ZMQ_SNDMORE) == SendResult::kSent) {
    static_cast<void>(socket_.send(payload, 0));
  }
}

}  // namespace palpate
