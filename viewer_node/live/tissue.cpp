// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/tissue.h"

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {

void check_control(const Session& session, const WebOptions& options) {
  if (!session.viewer.has_control || options.audience > 0) return;
  if (!options.is_enabled(session.viewer.web)) return;
  const auto refuse = [](const std::string& option) {
    throw SetupError(option +
                     ": viewer.control lets pages change the tissue, from 127.0.0.1 only; leave "
                     "the option out, or --set viewer.control=false");
  };
  if (!options.proxies.empty()) refuse("--proxy " + options.proxies.front());
  if (!is_loopback(web_config(options, session.viewer.web).address)) {
    refuse("--listen " + options.listen);
  }
}

WebTissue::WebTissue(NodeContext& context, ProcessLinks& links, WebServer& server)
    : context_(context), server_(server) {
  if (!context.session.viewer.has_control) return;
  out_.emplace(links.side, connect_to(context.session.tissue_change, "viewer.control"));
}

void WebTissue::take(std::uint64_t client, const std::string& payload, TimePoint now) {
  if (!out_) return;
  const auto complain = [&](const char* what) {
    server_.send_text_to(client, status_text(StatusLevel::kError, what));
  };
  auto change = decode_page_change(payload);
  if (!change) {
    complain("not a valid palpate.v1.TissueChange: stiffness 0 … 1e6 N/m, damping 0 … 1e4 N·s/m");
    return;
  }
  header_.session_id = context_.session_id;
  header_.sampled_at = now;
  change->header = header_;
  ++header_.sequence;
  if (out_->send(*change) != SendResult::kSent) complain("no physics_node to change the tissue");
}

}  // namespace palpate::viewer
