// SPDX-License-Identifier: Apache-2.0
// contenders.h — the controllers that the benches compare.
#pragma once

#include <string>
#include <vector>

namespace palpate::bench {

using Overrides = std::vector<std::string>;

struct Contender {
  std::string label;
  Overrides overrides;
  bool needs_model = false;  ///< of hop 3: only with `interaction: local`
};

[[nodiscard]] std::vector<Contender> contenders();

}  // namespace palpate::bench
