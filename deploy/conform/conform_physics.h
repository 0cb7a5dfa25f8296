// conform_physics.h — does a physics from elsewhere keep what mofc_node and the hand rely on?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/core/vector.h"

namespace palpate {

struct ConformFinding {
  std::string check;  ///< "stamps"
  bool is_good = false;
  std::string text;    ///< what was found
  std::string remedy;  ///< empty if it is good
};

struct ConformOptions {
  std::vector<std::string> command;  ///< program and arguments; {session} is the session file
  std::string session_file = {};  ///< empty: one with a half-space below z = 0, physics at 500 Hz
  std::vector<std::string> overrides = {};
  Vector3 clear_m{0.0, 0.0, 0.005};   ///< W, a place where the tool touches nothing
  Vector3 press_m{0.0, 0.0, -0.005};  ///< W, a place where it presses the tissue
  double seconds_to_start = 20.0;
  std::function<void(const ConformFinding&)> on_finding = {};  ///< called for each, in order
};

/// Starts the program, plays mofc_node to it along scripted motions, ends and restarts it, all in
/// about 5 s. Checks: start, answers, stamps, silence, delay, rest, jumps, energy, peers, restart,
/// stop.
/// @return a finding for each; those after a physics that never answers are missing
/// @throws SetupError  if the command or the session cannot be used
[[nodiscard]] std::vector<ConformFinding> conform_physics(const ConformOptions& options);

}  // namespace palpate
