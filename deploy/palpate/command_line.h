// SPDX-License-Identifier: Apache-2.0
// command_line.h — what palpate and palpate_tools do alike with their arguments.
#pragma once

#include <functional>
#include <vector>

#include "deploy/palpate/commands.h"

namespace palpate {

/// For words of the command line that no command takes: "lunch: did you mean launch?"; "" if
/// nothing is like them. Call it after app.parse() threw.
[[nodiscard]] std::string did_you_mean(const CLI::App& app);

/// Parses the arguments, runs the command that they name, and tells the user what failed.
/// @param add  adds the commands of the program to `app`
/// @return exit status
[[nodiscard]] int run_command_line(int argc, char** argv,
                                   const std::function<std::vector<Command>(CLI::App&)>& add);

}  // namespace palpate
