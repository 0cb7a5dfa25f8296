// version.h — the version of the project.
#pragma once

namespace palpate {

/// "MAJOR.MINOR.PATCH".
[[nodiscard]] const char* version();

}  // namespace palpate
