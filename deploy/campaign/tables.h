// SPDX-License-Identifier: Apache-2.0
// tables.h — what came out of a campaign: rows for other programs, a summary and maps for people.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "deploy/campaign/result_log.h"

namespace palpate::campaign {

/// One row for each run that is needed, in order: run, seed, the dimensions, the quantities,
/// violates. Quotes as RFC 4180; nothing where a quantity is not known.
[[nodiscard]] std::string csv_text(const Campaign& campaign, const Results& results);
/// The same as JSON lines: one object each; numbers where they are, null for what is not known.
[[nodiscard]] std::string json_lines(const Campaign& campaign, const Results& results);

/// Least, mean and greatest of each quantity with its runs; violations of each limit, with the
/// command line that repeats the worst one.
[[nodiscard]] std::string summary_text(const Campaign& campaign, const Results& results);

/// Runs that violate a limit.
[[nodiscard]] std::uint64_t violations(const Campaign& campaign, const Results& results);

/// The runs that are closest to the first limit or violate it most, worst first.
[[nodiscard]] std::vector<std::uint64_t> worst_runs(const Campaign& campaign,
                                                    const Results& results, std::size_t count);

}  // namespace palpate::campaign
