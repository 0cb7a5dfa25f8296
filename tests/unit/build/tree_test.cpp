// SPDX-License-Identifier: Apache-2.0
// What holds for the text of the tree as a whole.
#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/source_tree.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

using test::text_of;

struct Field {
  std::string type;
  std::string name;
};

/// The fields of a .proto file, `type name = number;`. Enumerators have no type.
std::vector<Field> fields_of(const std::string& proto) {
  static const std::regex field(
      R"(^\s*(?:optional\s+|repeated\s+)?([A-Za-z0-9_.]+)\s+(\w+)\s*=\s*\d+)");
  std::vector<Field> fields;
  std::istringstream lines(proto);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_search(line, match, field)) fields.push_back({match[1], match[2]});
  }
  return fields;
}

bool is_number(const std::string& type) {
  static const std::set<std::string> numbers{"double", "float",  "int32",  "int64",
                                             "uint32", "uint64", "sint32", "sint64"};
  return numbers.contains(type);
}

bool ends_with_unit(const std::string& name) {
  for (const char* unit : {"_m",
                           "_m_per_s",
                           "_newton",
                           "_newton_per_m",
                           "_newton_per_m3",
                           "_newton_s_per_m",
                           "_newton_per_s",
                           "_joule",
                           "_joule_per_m2",
                           "_watt",
                           "_m2_per_s3",
                           "_m2_per_s5",
                           "_kg",
                           "_kg_m2",
                           "_rad",
                           "_hz",
                           "_a",
                           "_s",
                           "_ms",
                           "_us",
                           "_ns",
                           "_ratio",
                           "_deg",
                           "_pa",
                           "_kg_per_m3",
                           "_per_s",
                           "_m_per_s2"}) {
    if (name.ends_with(unit)) return true;
  }
  return false;
}

// Counts, numbers that name something, and directions have no unit.
TEST(SessionFormat, EveryNumberSaysItsUnitInItsName) {
  const std::set<std::string> without_unit{
      "schema_version",
      "seed",
      "priority",
      "cpu",
      "button",
      "clutch_button",
      "dead_man_button",
      "burst_length",
      "most_points",
      "late_periods",
      "port",
      "normal",
      "tangent",
      "facing",
      "x",
      "y",
      "z",  // of a vector, which says it
      "ratio",
      "share",
      "friction_coefficient",
      "exponent",
      "device_id",
      "motor_port",
      "encoder_port",
      "encoder_resolution",
      "torque_gain",
      "largest_torque",
      "calibration_count",
  };
  std::string schema;
  for (const char* file : {"session", "session_device", "session_drivers", "session_hand",
                           "session_mofc", "session_scene", "session_vector"}) {
    schema += text_of(fs::path(test::source_dir() + "/proto/palpate/v1") / file += ".proto");
  }
  const std::vector<Field> fields = fields_of(schema);
  std::size_t numbers = 0;
  for (const Field& field : fields) {
    if (!is_number(field.type) && field.type != "Vector3d") continue;
    ++numbers;
    EXPECT_TRUE(ends_with_unit(field.name) || without_unit.contains(field.name))
        << field.type << " " << field.name;
  }
  EXPECT_GT(numbers, 70u);
}

TEST(SessionFormat, TheScanForUnitsFindsANumberWithout) {
  const auto fields = fields_of("  optional double stiffness = 1;  // k\n  Hold hold = 2;\n");
  ASSERT_EQ(fields.size(), 2u);
  EXPECT_TRUE(is_number(fields[0].type) && !ends_with_unit(fields[0].name));
  EXPECT_FALSE(is_number(fields[1].type));
}

/// The first absolute path of some machine's user or mount; empty if there is none.
std::string machine_path_in(const std::string& text) {
  for (const char* folder : {"home", "work", "root", "Users", "mnt", "media"}) {
    const std::string path = std::string("/") + folder + "/";
    for (std::size_t at = text.find(path); at != std::string::npos; at = text.find(path, at + 1)) {
      // after a folder, "~" or a variable the path is relative, as in "net/media"
      const char before = at > 0 ? text[at - 1] : ' ';
      const bool is_relative = std::isalnum(static_cast<unsigned char>(before)) != 0 ||
                               std::string("_.-~}/)*").find(before) != std::string::npos;
      if (!is_relative) return text.substr(at, 60);
    }
  }
  return {};
}

TEST(Tree, NamesNoPathOfAnyMachine) {
  std::size_t files = 0;
  for (const std::string& file : test::tracked_files()) {
    ++files;
    EXPECT_EQ(machine_path_in(text_of(fs::path(test::source_dir()) / file)), "") << file;
  }
  EXPECT_GT(files, 100u);
}

TEST(Tree, TheScanForPathsFindsOne) {
  const std::string folder = "home";
  EXPECT_NE(machine_path_in("see /" + folder + "/me/x.cpp"), "");
  EXPECT_NE(machine_path_in("\"/" + folder + "/me\""), "");
  EXPECT_EQ(machine_path_in("net/" + folder + "/me"), "");
}

}  // namespace
}  // namespace palpate
