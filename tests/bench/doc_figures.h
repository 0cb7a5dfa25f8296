// SPDX-License-Identifier: Apache-2.0
// doc_figures.h — the tables of figures in README.md and docs/, each made from the output of a
// bench or of `palpate loopback`.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace palpate::bench {

struct DocFigures {
  std::string name;  ///< in the marker of the document
  /// As a reader types them in the root of the repository, program first, without its folder.
  /// `--json FILE` is appended to each.
  std::vector<std::string> commands{};
  /// In lockstep, deterministic and short: a test compares the documents with a new run.
  bool is_checked = true;
  /// Of real processes in real time, on a quiet machine: refreshed only when it is named.
  bool is_of_real_time = false;
  /// The Markdown table. One JSON document per command, in their order.
  std::function<std::string(const std::vector<nlohmann::json>& outputs)> table{};

  /// The commands as the marker shows them.
  [[nodiscard]] std::string shown_commands() const;
};

[[nodiscard]] std::vector<DocFigures> doc_figures();

}  // namespace palpate::bench
