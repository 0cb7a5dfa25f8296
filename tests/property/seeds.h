// SPDX-License-Identifier: Apache-2.0
// seeds.h — how many random runs a test makes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace palpate::test {

/// Whether this is a build with a sanitizer, which looks for other errors and is tens of times
/// slower: there tests compute smaller examples.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

/// `usual` runs, a quarter of them under a sanitizer, times PALPATE_SEEDS of the environment.
inline std::uint64_t seed_count(std::uint64_t usual) {
  if (kIsSanitized) usual = std::max<std::uint64_t>(1, usual / 4);
  const char* factor = std::getenv("PALPATE_SEEDS");
  return usual * (factor != nullptr ? std::strtoull(factor, nullptr, 10) : 1);
}

/// How many random places a test looks at: a tenth of `usual` under a sanitizer.
constexpr int place_count(int usual) { return kIsSanitized ? usual / 10 : usual; }

/// 1 to seed_count(usual).
inline std::vector<std::uint64_t> seeds(std::uint64_t usual) {
  std::vector<std::uint64_t> all;
  for (std::uint64_t seed = 1; seed <= seed_count(usual); ++seed) all.push_back(seed);
  return all;
}

}  // namespace palpate::test
