// SPDX-License-Identifier: Apache-2.0
// class_page.h — the scores of many runs as one HTML file, for people who do not read plots.
#pragma once

#include <string>
#include <vector>

#include "common/task/score_table.h"

namespace palpate {

/// What all runs say together, a table with a line for each, and what was said of each. It loads
/// nothing, and has no script.
[[nodiscard]] std::string class_html(const std::vector<NamedScore>& scores);

}  // namespace palpate
