// SPDX-License-Identifier: Apache-2.0
// The schema of the session and its reference, docs/session.md.
#include "common/session/reference/session_reference.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <iterator>
#include <set>
#include <string>

#include "common/session/file/session_rules.h"
#include "palpate/v1/session.pb.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

namespace pb = google::protobuf;

using ::testing::HasSubstr;

std::string content_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// All fields below the session, each once; of a vector not its components.
void for_each_field(const std::function<void(const pb::FieldDescriptor&)>& visit) {
  std::set<const pb::Descriptor*> seen;
  const std::function<void(const pb::Descriptor&)> walk = [&](const pb::Descriptor& message) {
    if (message.name() == "Vector3d" || !seen.insert(&message).second) return;
    for (int i = 0; i < message.field_count(); ++i) {
      visit(*message.field(i));
      if (message.field(i)->message_type() != nullptr) walk(*message.field(i)->message_type());
    }
  };
  walk(*v1::Session::descriptor());
}

bool is_vector(const pb::FieldDescriptor& field) {
  return field.message_type() != nullptr && field.message_type()->name() == "Vector3d";
}

TEST(SessionReference, IsUpToDate) {
  EXPECT_TRUE(session_reference(content_of(PALPATE_SESSION_DESCRIPTOR_SET)) ==
              content_of(test::source_dir() + "/docs/session.md"))
      << "docs/session.md is older than proto/palpate/v1/session*.proto; refresh it with\n"
         "  cmake --build build/release --target session_reference";
}

TEST(SessionReference, HasUnitRangeDefaultAndMeaningOfAField) {
  const std::string text = session_reference(content_of(PALPATE_SESSION_DESCRIPTOR_SET));

  EXPECT_THAT(text,
              HasSubstr("| `mass_kg` | number | kg | > 0 | 0.045 | Mass of the moving parts. |"));
  EXPECT_THAT(text, HasSubstr("| `apex_m` | vector | m | – | 0, 0, -0.02 | Lowest point. |"));
  EXPECT_THAT(text,
              HasSubstr("| `lease_us` | number | µs | > 0 | 1 period and 1 ms, at most 2 periods; "
                        "at 400 Hz and below 1 period |"));
}

TEST(SessionReference, EveryFieldHasAMeaning) {
  EXPECT_THAT(session_reference(content_of(PALPATE_SESSION_DESCRIPTOR_SET)),
              ::testing::Not(HasSubstr("| – |\n")));
}

TEST(SessionReference, NeedsADescriptorSetOfTheSchema) {
  EXPECT_THROW(static_cast<void>(session_reference("nonsense")), std::runtime_error);
  EXPECT_THROW(static_cast<void>(session_reference("")), std::runtime_error);
}

// The unit is in the name and in the rule: they must agree.
TEST(SessionSchema, UnitsAreThoseOfTheNames) {
  const std::pair<const char*, const char*> units[] = {{"_newton_m_per_a", "N·m/A"},
                                                       {"_current_a", "A"},
                                                       {"_newton_s_per_m", "N·s/m"},
                                                       {"_newton_m_s_per_rad", "N·m·s/rad"},
                                                       {"_newton_m_per_rad", "N·m/rad"},
                                                       {"_newton_per_s", "N/s"},
                                                       {"_newton_s", "N·s"},
                                                       {"_newton_per_m3", "N/m³"},
                                                       {"_newton_per_m", "N/m"},
                                                       {"_newton_m", "N·m"},
                                                       {"_newton", "N"},
                                                       {"_m2_per_s3", "m²/s³"},
                                                       {"_m2_per_s5", "m²/s⁵"},
                                                       {"_m_per_s2", "m/s²"},
                                                       {"_m_per_s", "m/s"},
                                                       {"_kg_per_m3", "kg/m³"},
                                                       {"_rad_per_s", "rad/s"},
                                                       {"_per_s", "1/s"},
                                                       {"_pa_per_m", "Pa/m"},
                                                       {"_pa", "Pa"},
                                                       {"_deg", "°"},
                                                       {"_joule_per_kg", "J/kg"},
                                                       {"_joule_per_m2", "J/m²"},
                                                       {"_joule", "J"},
                                                       {"_watt", "W"},
                                                       {"_kg_m2", "kg·m²"},
                                                       {"_kg", "kg"},
                                                       {"_hz", "Hz"},
                                                       {"_rad", "rad"},
                                                       {"_ms", "ms"},
                                                       {"_us", "µs"},
                                                       {"_s", "s"},
                                                       {"_m", "m"}};
  int checked = 0;
  for_each_field([&](const pb::FieldDescriptor& field) {
    if (field.cpp_type() != pb::FieldDescriptor::CPPTYPE_DOUBLE && !is_vector(field)) return;
    std::string expected;
    for (const auto& [suffix, unit] : units) {
      if (expected.empty() && field.name().ends_with(suffix)) expected = unit;
    }
    EXPECT_EQ(rule_of(field).unit(), expected) << field.full_name();
    ++checked;
  });
  EXPECT_GT(checked, 100);
}

TEST(SessionSchema, DefaultsAreWithinTheirRanges) {
  for_each_field([](const pb::FieldDescriptor& field) {
    const v1::FieldRule& rule = rule_of(field);
    const bool is_number = field.cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE ||
                           field.cpp_type() == pb::FieldDescriptor::CPPTYPE_INT32 ||
                           field.cpp_type() == pb::FieldDescriptor::CPPTYPE_UINT32;
    if (!is_number || rule.required() || !rule.computed_default().empty()) return;
    EXPECT_EQ(range_complaint(rule, rule.default_value()), "") << field.full_name();
  });
}

TEST(SessionSchema, ARangeHasARemedy) {
  for_each_field([](const pb::FieldDescriptor& field) {
    const v1::FieldRule& rule = rule_of(field);
    if (range_text(rule).empty() && !rule.required()) return;
    EXPECT_NE(rule.remedy(), "") << field.full_name();
  });
}

}  // namespace
}  // namespace palpate
