// SPDX-License-Identifier: Apache-2.0
// slurm.h — computes a campaign as an array job of Slurm: one task for each share, on any machines
// that see the folder. Whatever dies, what is written is kept; the same call goes on.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "deploy/campaign/folder.h"
#include "deploy/campaign/result_log.h"

namespace palpate::campaign {

struct SlurmOptions {
  std::uint64_t shares = 1;            ///< tasks of the array
  std::vector<std::string> sbatch;     ///< more arguments of sbatch, as --partition=long
  std::vector<std::string> arguments;  ///< of `palpate sweep`, for every task: the campaign, --runs
  std::function<void(const std::string&)> say;  ///< one line about what happens
  /// Called now and then with the runs done since the call and those to do. False leaves the job to
  /// itself.
  std::function<bool(std::uint64_t done, std::uint64_t of)> may_go_on;
};

/// Submits the job, or finds the one that an earlier call submitted; waits, collects, and submits
/// again what tasks that died have left. A task whose command a signal kills begins it again at
/// once. Throws SetupError if sbatch refuses or is missing,
/// std::runtime_error if the tasks compute nothing.
/// @return false if it was left to itself
bool compute_with_slurm(const Campaign& campaign, const Folder& folder, Results& results,
                        const SlurmOptions& options);

}  // namespace palpate::campaign
