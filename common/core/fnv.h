// fnv.h — the FNV-1a hash. Not cryptographic: for seeds, version tags and comparisons only.
#pragma once

#include <cstdint>
#include <string_view>

namespace palpate {

/// 64-bit FNV-1a of the bytes of `text`.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::string_view text) noexcept {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

}  // namespace palpate
