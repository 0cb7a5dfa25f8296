// SPDX-License-Identifier: Apache-2.0
// session_paths.h — what `--set` accepts, for the completion of shells.
#pragma once

#include <string>
#include <vector>

namespace palpate {

/// "device.rate_hz=", "mofc.mode=guard": every field of a session outside of lists; with each value
/// of an enumeration or a switch.
[[nodiscard]] std::vector<std::string> session_paths();

}  // namespace palpate
