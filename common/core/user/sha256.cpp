// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/sha256.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace palpate {
namespace {

__extension__ using Wide = unsigned __int128;
using Words = std::array<std::uint32_t, 8>;

constexpr std::size_t kBlockBytes = 64;
constexpr int kRounds = 64;

constexpr std::array<std::uint32_t, kRounds> first_primes() {
  std::array<std::uint32_t, kRounds> primes{};
  std::uint32_t candidate = 2;
  for (std::uint32_t& prime : primes) {
    for (std::uint32_t d = 2; d * d <= candidate;) {
      if (candidate % d != 0) {
        ++d;
        continue;
      }
      ++candidate;
      d = 2;
    }
    prime = candidate++;
  }
  return primes;
}

/// The first 32 bits of the fraction of the `degree`-th root of n, exact.
std::uint32_t root_fraction(std::uint32_t n, int degree) {
  // the largest r with r^degree ≤ n · 2^(32·degree), by bits from the top
  const int bits = 36;  // cube root of 311 · 2^96 is below 2^35
  Wide root = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    const Wide tried = root | (Wide{1} << bit);
    Wide power = tried * tried;
    Wide limit = Wide{n} << 64;
    if (degree == 3) {
      power *= tried;
      limit <<= 32;
    }
    if (power <= limit) root = tried;
  }
  return static_cast<std::uint32_t>(root);
}

struct Constants {
  Words start{};
  std::array<std::uint32_t, kRounds> round{};
};

const Constants& constants() {
  static const Constants made = [] {
    Constants constants;
    const auto primes = first_primes();
    for (std::size_t i = 0; i < constants.start.size(); ++i) {
      constants.start[i] = root_fraction(primes[i], 2);
    }
    for (std::size_t i = 0; i < primes.size(); ++i) {
      constants.round[i] = root_fraction(primes[i], 3);
    }
    return constants;
  }();
  return made;
}

void add_block(std::string_view block, Words& state) {
  std::array<std::uint32_t, kRounds> w{};
  for (std::size_t i = 0; i < 16; ++i) {
    for (std::size_t byte = 0; byte < 4; ++byte) {
      w[i] = (w[i] << 8U) | static_cast<unsigned char>(block[4 * i + byte]);
    }
  }
  for (std::size_t i = 16; i < w.size(); ++i) {
    const std::uint32_t s0 = std::rotr(w[i - 15], 7) ^ std::rotr(w[i - 15], 18) ^ (w[i - 15] >> 3U);
    const std::uint32_t s1 = std::rotr(w[i - 2], 17) ^ std::rotr(w[i - 2], 19) ^ (w[i - 2] >> 10U);
    w[i] = w[i - 16] + s0 + w[i - 7] + s1;
  }
  auto [a, b, c, d, e, f, g, h] = state;
  for (std::size_t i = 0; i < w.size(); ++i) {
    const std::uint32_t s1 = std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25);
    const std::uint32_t chosen = (e & f) ^ (~e & g);
    const std::uint32_t t1 = h + s1 + chosen + constants().round[i] + w[i];
    const std::uint32_t s0 = std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22);
    const std::uint32_t most = (a & b) ^ (a & c) ^ (b & c);
    h = g;
    g = f;
    f = e;
    e = d + t1;
    d = c;
    c = b;
    b = a;
    a = t1 + s0 + most;
  }
  const Words mixed{a, b, c, d, e, f, g, h};
  for (std::size_t i = 0; i < state.size(); ++i) state[i] += mixed[i];
}

}  // namespace

std::string sha256_hex(std::string_view bytes) {
  Words state = constants().start;
  std::string_view rest = bytes;
  for (; rest.size() >= kBlockBytes; rest.remove_prefix(kBlockBytes)) {
    add_block(rest.substr(0, kBlockBytes), state);
  }
  // the end: a bit 1, zeros, the length in bits
  std::string end(rest);
  end += '\x80';
  while (end.size() % kBlockBytes != kBlockBytes - 8) end += '\0';
  const std::uint64_t bits = 8 * std::uint64_t{bytes.size()};
  for (int shift = 56; shift >= 0; shift -= 8) end += static_cast<char>(bits >> shift);
  for (std::size_t at = 0; at < end.size(); at += kBlockBytes) {
    add_block(std::string_view(end).substr(at, kBlockBytes), state);
  }
  std::string hex;
  for (const std::uint32_t word : state) {
    for (int shift = 28; shift >= 0; shift -= 4) hex += "0123456789abcdef"[(word >> shift) & 0xFU];
  }
  return hex;
}

}  // namespace palpate
