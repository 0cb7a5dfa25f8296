// SPDX-License-Identifier: Apache-2.0
// chosen_segments.h — what --label, --lesion and --fixed mean.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "deploy/scan/label_map.h"

namespace palpate {

/// The segments of these names or label values, ascending. A name counts before a value.
/// @param option  begins the message of a SetupError
/// @throws SetupError  there is no such segment, or a value is that of several
[[nodiscard]] std::vector<std::uint32_t> segments_named(const scan::LabelMap& map,
                                                        const std::vector<std::string>& names,
                                                        const char* option);

}  // namespace palpate
