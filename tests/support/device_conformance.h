// SPDX-License-Identifier: Apache-2.0
// device_conformance.h — device_checks.h as tests. To run a driver through them:
//
//   std::unique_ptr<device::DeviceBench> open_mine();
//   PALPATE_DEVICE_CONFORMANCE(Mine, open_mine);
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <memory>
#include <string>
#include <tuple>

#include "device_node/conformance/device_checks.h"

namespace palpate::test {

using OpenBench = std::unique_ptr<device::DeviceBench> (*)();

/// One check of one driver, each with a device that was just opened.
class DeviceConformance
    : public testing::TestWithParam<std::tuple<OpenBench, device::DeviceCheck>> {
 public:
  static std::string name_of(const testing::TestParamInfo<ParamType>& info) {
    std::string name = std::get<device::DeviceCheck>(info.param).name;
    for (char& letter : name) {
      if (std::isalnum(static_cast<unsigned char>(letter)) == 0) letter = '_';
    }
    return name;
  }

 protected:
  void passes() {
    const auto& [open, check] = GetParam();
    const auto bench = open();

    const device::CheckOutcome outcome = check.run(*bench);

    if (outcome.verdict == device::CheckVerdict::kNotObservable) GTEST_SKIP() << outcome.text;
    EXPECT_EQ(outcome.verdict, device::CheckVerdict::kGood) << outcome.text << "; " << check.remedy;
  }
};

/// In namespace palpate::test.
#define PALPATE_DEVICE_CONFORMANCE(driver, open)                                         \
  class driver##Conformance : public DeviceConformance {};                               \
  TEST_P(driver##Conformance, Passes) { passes(); }                                      \
  INSTANTIATE_TEST_SUITE_P(Each, driver##Conformance,                                    \
                           testing::Combine(testing::Values(OpenBench(open)),            \
                                            testing::ValuesIn(device::device_checks())), \
                           DeviceConformance::name_of)

}  // namespace palpate::test
