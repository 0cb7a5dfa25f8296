// SPDX-License-Identifier: Apache-2.0
// conform_physics.h — does a physics from elsewhere keep what mofc_node and the hand rely on?
#pragma once

#include <string>
#include <vector>

#include "common/core/vector.h"
#include "deploy/conform/finding.h"

namespace palpate {

struct ConformOptions {
  /// Program and arguments, {session} is the session file; empty: physics.command of the session.
  std::vector<std::string> command = {};
  std::string session_file = {};  ///< empty: one with a half-space below z = 0, physics at 500 Hz
  std::vector<std::string> overrides = {};
  Vector3 clear_m{0.0, 0.0, 0.005};   ///< W, a place where the tool touches nothing
  Vector3 press_m{0.0, 0.0, -0.005};  ///< W, a place where it presses the tissue
  double seconds_to_start = 20.0;
  OnFinding on_finding = {};
};

/// Starts the program, plays mofc_node to it along scripted motions, ends and restarts it, all in
/// about 10 s. Checks: start, answers, rate, stamps, silence, delay, rest, jumps, contacts, model,
/// energy, sides, peers, restarts, suspension, stop. What depends on time is not judged
/// (is_checked) if it falls short while the machine keeps the program from a processor.
/// @return a finding for each; those after a physics that never answers are missing
/// @throws SetupError  if the command or the session cannot be used
[[nodiscard]] std::vector<ConformFinding> conform_physics(const ConformOptions& options);

}  // namespace palpate
