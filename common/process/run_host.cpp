// SPDX-License-Identifier: Apache-2.0
#include "common/process/run_host.h"

#include "common/process/run_node.h"
#include "common/session/session_file.h"

namespace palpate {
namespace {

Attachment in_run_folder(const Session& session, const char* name, Attachment::Role role) {
  return {role, "ipc://" + (run_folder(session.name) / name).string() + ".ipc",
          std::string("the run folder's ") + name};
}

}  // namespace

Attachment run_state_of(const Session& session, Attachment::Role role) {
  return in_run_folder(session, "run_state", role);
}
Attachment run_requests_of(const Session& session, Attachment::Role role) {
  return in_run_folder(session, "run_requests", role);
}

RunHost::RunHost(ZmqContext& context, const Clock& clock, const Session& session)
    : clock_(clock),
      states_(context, run_state_of(session, Attachment::Role::kBind)),
      requests_(context, clock, run_requests_of(session, Attachment::Role::kBind)),
      header_{.session_id = random_session_id()} {}

std::optional<RunRequest> RunHost::take() noexcept {
  RunRequest request;
  TimePoint received_at;
  if (!requests_.receive(request, received_at)) return std::nullopt;
  return request;
}

void RunHost::publish(RunState& state, bool is_new) {
  const TimePoint now = clock_.now();
  if (now < next_ && !is_new) return;
  next_ = now + kInterval;
  header_.sampled_at = now;
  state.header = header_;
  if (states_.send(state) == SendResult::kSent) ++header_.sequence;
}

}  // namespace palpate
