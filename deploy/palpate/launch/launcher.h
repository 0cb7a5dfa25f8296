// SPDX-License-Identifier: Apache-2.0
// launcher.h — the command line of palpate itself.
#pragma once

namespace palpate {

/// Launches the session that the arguments name. Throws nothing.
/// @return exit status
[[nodiscard]] int run_launcher(int argc, char** argv);

}  // namespace palpate
