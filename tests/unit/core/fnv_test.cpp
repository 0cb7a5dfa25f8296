// SPDX-License-Identifier: Apache-2.0
// The FNV-1a hash.
#include "common/core/random.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

// Test vectors of the authors of FNV (draft-eastlake-fnv, 64 bits).
TEST(Fnv, GivesThePublishedValues) {
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325U);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cU);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8U);
}

TEST(Fnv, HashesBytesAboveAsciiAsUnsigned) {
  // one step: (offset basis ^ 0xff) * prime
  EXPECT_EQ(fnv1a("\xff"), (14695981039346656037U ^ 0xffU) * 1099511628211U);
}

}  // namespace
}  // namespace palpate
