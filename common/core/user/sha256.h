// SPDX-License-Identifier: Apache-2.0
// sha256.h — SHA-256, by which a file is recognised that nobody can have exchanged.
#pragma once

#include <string>
#include <string_view>

namespace palpate {

/// The hash of FIPS 180-4 as 64 hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace palpate
