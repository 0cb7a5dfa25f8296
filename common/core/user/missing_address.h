// SPDX-License-Identifier: Apache-2.0
// missing_address.h — the one set-up error that may pass by itself.
#pragma once

#include "common/core/check.h"

namespace palpate {

/// This machine does not have the address or interface to bind, or not yet: at boot a service may
/// start before its network.
class MissingAddress : public SetupError {
 public:
  using SetupError::SetupError;
};

}  // namespace palpate
