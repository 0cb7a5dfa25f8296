// doctor.h — `palpate doctor`: is this machine fit for a session, and if not, what to do.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

struct Finding {
  std::string what;      ///< "timer"
  std::string text;      ///< what was found
  std::string remedy{};  ///< what to do; empty: all is well
};

/// Real-time permission, timer lateness, locked memory, clock source; with a session its links,
/// ports and keys, as far as this machine has to do with them. Takes about a second.
[[nodiscard]] std::vector<Finding> examine_machine(const std::optional<Session>& session);

/// A line each.
[[nodiscard]] std::string findings_text(const std::vector<Finding>& findings);

}  // namespace palpate
