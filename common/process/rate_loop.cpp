#include "common/process/rate_loop.h"

#include <sys/prctl.h>

namespace palpate {

void RateLoop::wake_exactly() noexcept {
  // cannot fail for a thread's own slack of 1 ns
  prctl(PR_SET_TIMERSLACK, 1);
}

}  // namespace palpate
