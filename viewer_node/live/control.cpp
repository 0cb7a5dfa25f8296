// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/control.h"

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {

void check_control(const Session& session, const WebOptions& options) {
  if (!session.viewer.has_control || options.audience > 0) return;
  if (!options.is_enabled(session.viewer.web)) return;
  const auto refuse = [](const std::string& option) {
    throw SetupError(option +
                     ": viewer.control lets pages acknowledge a device or change the tissue, from "
                     "127.0.0.1 only; leave the option out, or --set viewer.control=false");
  };
  if (!options.proxies.empty()) refuse("--proxy " + options.proxies.front());
  if (!is_loopback(web_config(options, session.viewer.web).address)) {
    refuse("--listen " + options.listen);
  }
}

WebControl::WebControl(NodeContext& context, ProcessLinks& links,
                       std::span<const TelemetryMirror> mirrors, WebServer& server)
    : mirrors_(mirrors), server_(server) {
  header_.session_id = context.session_id;
  if (!context.session.viewer.has_control) return;
  if (may_change_tissue(context.session)) {
    changes_.emplace(links.side, connect_to(context.session.tissue_change, "viewer.control"));
  }
  for (const Side& side : context.session.sides) {
    to_devices_.emplace_back(links.side, connect_to(side.links.acknowledgement, "viewer.control"));
  }
}

void WebControl::change(std::uint64_t client, const std::string& payload, TimePoint now) {
  if (!changes_) return;
  auto change = decode_page_change(payload);
  if (!change) {
    complain(
        client,
        "not a valid palpate.v1.TissueChange: stiffness 0 … 1e6 N/m, damping 0 … 1e4 N·s/m, or "
        "restores");
  } else if (!send(*change, *changes_, now)) {
    complain(client, "no physics_node to change the tissue");
  }
}

void WebControl::acknowledge(std::uint64_t client, const std::string& payload, TimePoint now) {
  if (to_devices_.empty()) return;
  auto acknowledgement = decode_page_acknowledgement(payload);
  if (!acknowledgement) {
    complain(client, "not a valid palpate.v1.Acknowledgement: device_session_id, phase 2, 3 or 5");
    return;
  }
  for (std::size_t side = 0; side < to_devices_.size(); ++side) {
    if (mirrors_[side].device_session_id() != acknowledgement->device_session_id) continue;
    if (send(*acknowledgement, to_devices_[side], now)) return;
  }
  complain(client, "no such device_node to acknowledge on this machine");
}

template <class T>
bool WebControl::send(T& message, ZmqSender<T>& out, TimePoint now) {
  header_.sampled_at = now;
  message.header = header_;
  ++header_.sequence;
  return out.send(message) == SendResult::kSent;
}

void WebControl::complain(std::uint64_t client, const char* what) {
  server_.send_text_to(client, status_text(StatusLevel::kError, what));
}

}  // namespace palpate::viewer
