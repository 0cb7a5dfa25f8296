// SPDX-License-Identifier: Apache-2.0
#include "common/process/rate_loop.h"

#include <sys/prctl.h>

namespace palpate {

void RateLoop::wake_exactly() noexcept {
  // cannot fail: a thread may always set its own slack
  prctl(PR_SET_TIMERSLACK, 1);
}

}  // namespace palpate
