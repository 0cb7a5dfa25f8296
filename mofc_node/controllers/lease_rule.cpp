// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/lease_rule.h"

namespace palpate::controllers {
namespace {

constexpr double kSpan_s = 1.0;
constexpr int kLeastHoles = 3;

}  // namespace

void HoleLengths::note(double duration_s, double hold_s) noexcept {
  span_s_ += duration_s;
  if (span_s_ > kSpan_s) {
    spans_ = {Span{}, span_s_ > 2.0 * kSpan_s ? Span{} : spans_[0]};
    span_s_ = 0.0;
  }
  if (duration_s <= hold_s) return;
  spans_[0].longest_s = std::max(spans_[0].longest_s, duration_s);
  ++spans_[0].count;
}

double HoleLengths::longest_s() const noexcept {
  if (spans_[0].count + spans_[1].count < kLeastHoles) return 0.0;
  return std::max(spans_[0].longest_s, spans_[1].longest_s);
}

}  // namespace palpate::controllers
