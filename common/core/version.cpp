// SPDX-License-Identifier: Apache-2.0
#include "common/core/version.h"

#include "commit.h"

namespace palpate {

const char* version() { return PALPATE_VERSION PALPATE_COMMIT; }

}  // namespace palpate
