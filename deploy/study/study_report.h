// SPDX-License-Identifier: Apache-2.0
// study_report.h — what a study has measured: one table, and what it says of the conditions.
#pragma once

#include <string>

#include "deploy/study/folder.h"
#include "deploy/study/plan.h"

namespace palpate::study {

/// All rows. @param is_open  with a column `condition`: no longer blind
[[nodiscard]] std::string table_csv(const Plan& plan, const Folder& folder, bool is_open);

/// Of each condition the trials and, with a staircase, the threshold: geometric mean over the
/// participants with its 95 % interval (t of the logarithms). @param is_open  by name, not code
[[nodiscard]] std::string summary_text(const Plan& plan, const Folder& folder, bool is_open);

}  // namespace palpate::study
