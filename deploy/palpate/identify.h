// identify.h — `palpate identify`: the friction of a session's device, measured (device_node/
// friction_identification.h), as a table and as a device profile.
#pragma once

#include <string>

#include "common/session/session.h"

namespace palpate {

struct IdentifyOptions {
  std::string profile_file = {};   ///< empty: none is written
  bool may_move_hardware = false;  ///< the user agreed
};

/// Sweeps the device of the session, without a hand, and prints a row per line as it goes. A
/// simulated device starts in the middle of its workspace and runs on virtual time.
/// @throws SetupError                   refused, or the profile cannot be written
/// @throws device::IdentificationError  a bound was reached or the device failed
void run_identify(const Session& session, const IdentifyOptions& options);

}  // namespace palpate
