// SPDX-License-Identifier: Apache-2.0
// check_outcome.h — what the checks of a driver say, and how they end.
#pragma once

#include <spdlog/fmt/fmt.h>

#include <string>
#include <utility>

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

inline CheckOutcome good(std::string text) { return {CheckVerdict::kGood, std::move(text)}; }
inline CheckOutcome failed(std::string text) { return {CheckVerdict::kFailed, std::move(text)}; }
/// A transfer failed, which tells nothing of what the check is about.
inline CheckOutcome failed_exchange(const std::string& text) {
  return {
      CheckVerdict::kFailed, text,
      "a transfer failed, so this says nothing of the arm: check the cable and the supply, stop "
      "other programs, and see whether a longer time of the driver's transfers helps"};
}
inline CheckOutcome not_observable(std::string text) {
  return {CheckVerdict::kNotObservable, std::move(text)};
}

inline std::string text_of(const Vector3& v, double scale, const char* unit) {
  return fmt::format("({:.3g}, {:.3g}, {:.3g}) {}", scale * v.x(), scale * v.y(), scale * v.z(),
                     unit);
}

/// Motors limp at the end of a check, however it ends.
class Limp {
 public:
  explicit Limp(HapticDevice& device) : device_(device) {}
  Limp(const Limp&) = delete;
  Limp& operator=(const Limp&) = delete;
  ~Limp() { static_cast<void>(device_.release()); }

 private:
  HapticDevice& device_;
};

}  // namespace palpate::device
