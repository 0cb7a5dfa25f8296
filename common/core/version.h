// SPDX-License-Identifier: Apache-2.0
// version.h — the version of the project.
#pragma once

namespace palpate {

/// "MAJOR.MINOR.PATCH+COMMIT", the commit with ".changed" if the sources were changed since;
/// without it outside a repository.
[[nodiscard]] const char* version();

}  // namespace palpate
