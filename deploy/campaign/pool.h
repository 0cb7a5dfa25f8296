// SPDX-License-Identifier: Apache-2.0
// pool.h — computes a campaign with worker processes on this machine. Any of them, or all, may be
// killed at any moment: what they have written is kept, the rest is computed.
#pragma once

#include <cstdint>
#include <functional>

#include "deploy/campaign/folder.h"
#include "deploy/campaign/result_log.h"

namespace palpate::campaign {

struct PoolOptions {
  unsigned workers = 1;
  /// Called now and then with the runs done in this call and those to do. False ends the work.
  std::function<bool(std::uint64_t done, std::uint64_t of)> may_go_on;
};

/// Computes what is missing in `results`, and adds it. Throws SetupError if the session of a run is
/// refused, std::runtime_error if a worker fails or one run ends its worker three times. Call it
/// while this process has one thread.
/// @return false if it was ended
bool compute_all(const Campaign& campaign, const Folder& folder, Results& results,
                 const PoolOptions& options);

/// Computes, in this process, the missing runs of one share: those whose number is `share` modulo
/// `shares`. Others may compute other shares at the same time, also on other machines.
/// @return false if it was ended
bool compute_share(const Campaign& campaign, const Folder& folder, Results& results,
                   std::uint64_t share, std::uint64_t shares,
                   const std::function<bool(std::uint64_t done, std::uint64_t of)>& may_go_on);

}  // namespace palpate::campaign
