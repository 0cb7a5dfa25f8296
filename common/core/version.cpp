#include "common/core/version.h"

namespace palpate {

const char* version() { return PALPATE_VERSION; }

}  // namespace palpate
