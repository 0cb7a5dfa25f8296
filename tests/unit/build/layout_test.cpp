// SPDX-License-Identifier: Apache-2.0
// The shape of the tree: includes without cycles, folders and files of a size that can be read.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
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

/// File → the project's files that it includes; paths from the root.
using IncludeGraph = std::map<std::string, std::vector<std::string>>;

/// A cycle as "a.h → b.h → a.h"; empty if there is none.
std::string cycle_in(const IncludeGraph& graph) {
  std::set<std::string> done;
  std::vector<std::string> path;
  std::string cycle;
  const std::function<void(const std::string&)> visit = [&](const std::string& file) {
    if (!cycle.empty() || done.contains(file)) return;
    const auto at = std::find(path.begin(), path.end(), file);
    if (at != path.end()) {
      for (auto it = at; it != path.end(); ++it) cycle += *it + " → ";
      cycle += file;
      return;
    }
    path.push_back(file);
    if (const auto node = graph.find(file); node != graph.end()) {
      for (const std::string& included : node->second) visit(included);
    }
    path.pop_back();
    done.insert(file);
  };
  for (const auto& [file, includes] : graph) visit(file);
  return cycle;
}

IncludeGraph graph_of_this_tree() {
  IncludeGraph graph;
  for (const std::string& file :
       test::sources_below({"common", "device_node", "mofc_node", "physics_node", "viewer_node",
                            "deploy", "tests"})) {
    std::ifstream in(fs::path(test::source_dir()) / file);
    for (std::string line; std::getline(in, line);) {
      if (!line.starts_with("#include \"")) continue;
      const std::string header = line.substr(10, line.find('"', 10) - 10);
      if (fs::exists(fs::path(test::source_dir()) / header)) graph[file].push_back(header);
    }
  }
  return graph;
}

TEST(Includes, FormNoCycle) {
  const IncludeGraph graph = graph_of_this_tree();
  EXPECT_GT(graph.size(), 200u);
  EXPECT_EQ(cycle_in(graph), "");
}

TEST(Includes, TheSearchForCyclesFindsOne) {
  EXPECT_EQ(cycle_in({{"a.h", {"b.h", "d.h"}}, {"b.h", {"c.h"}}, {"c.h", {"b.h"}}}),
            "b.h → c.h → b.h");
  EXPECT_EQ(cycle_in({{"a.h", {"a.h"}}}), "a.h → a.h");
  EXPECT_EQ(cycle_in({{"a.h", {"b.h", "c.h"}}, {"b.h", {"c.h"}}}), "");
}

// Fuzz corpora are data.
TEST(Tree, HasNoFolderOfMoreThanTwentyFiveFiles) {
  constexpr std::size_t kMostFiles = 25;
  std::map<std::string, std::size_t> files;
  for (const std::string& file : test::tracked_files()) {
    if (!file.starts_with("tests/fuzz/corpus/")) ++files[fs::path(file).parent_path().string()];
  }
  EXPECT_GT(files.size(), 40u);
  for (const auto& [folder, count] : files) EXPECT_LE(count, kMostFiles) << folder;
}

TEST(Tree, HasNoProductFileOfMoreThanFiveHundredLines) {
  constexpr std::ptrdiff_t kMostLines = 500;
  for (const std::string& file : test::sources_below(
           {"common", "device_node", "mofc_node", "physics_node", "viewer_node", "deploy"})) {
    std::ifstream in(fs::path(test::source_dir()) / file);
    const auto lines = std::count(std::istreambuf_iterator<char>(in), {}, '\n');
    EXPECT_LE(lines, 1 + kMostLines) << file;  // and the one that names the licence
  }
}

/// Whether a file is a source by its name, or without a suffix by its first line.
bool is_source(const std::string& file, const std::string& text) {
  static const std::set<std::string> suffixes{".h",     ".cpp", ".c",   ".S",  ".proto",
                                              ".ts",    ".mjs", ".js",  ".py", ".sh",
                                              ".cmake", ".css", ".html"};
  if (file.starts_with("tests/fuzz/corpus/")) return false;  // data
  const fs::path path(file);
  if (path.filename() == "CMakeLists.txt") return true;
  return path.has_extension() ? suffixes.contains(path.extension().string())
                              : text.starts_with("#!");
}

/// Whether the licence stands in the first line, or in the second below a #! or <!doctype line.
bool names_its_licence(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  if (line.starts_with("#!") || line.starts_with("<!doctype")) std::getline(lines, line);
  return line.find("SPDX-License-Identifier: Apache-2.0") != std::string::npos;
}

TEST(Tree, NamesTheLicenceInEverySource) {
  std::size_t sources = 0;
  for (const std::string& file : test::tracked_files()) {
    const std::string text = test::text_of(fs::path(test::source_dir()) / file);
    if (!is_source(file, text)) continue;
    ++sources;
    EXPECT_TRUE(names_its_licence(text))
        << file << ": begin it with a comment: SPDX-License-Identifier: Apache-2.0";
  }
  EXPECT_GT(sources, 1000u);
}

TEST(Tree, TheScanForLicencesFindsASourceWithout) {
  EXPECT_TRUE(is_source("deploy/x", "#!/bin/sh\n"));
  EXPECT_FALSE(is_source("deploy/x", "text\n"));
  EXPECT_FALSE(is_source("docs/x.md", "text\n"));
  EXPECT_TRUE(names_its_licence("#!/bin/sh\n# SPDX-License-Identifier: Apache-2.0\n"));
  EXPECT_TRUE(names_its_licence("/* SPDX-License-Identifier: Apache-2.0 */\n"));
  EXPECT_FALSE(names_its_licence("#!/bin/sh\n"));
  EXPECT_FALSE(names_its_licence("// a.h\n// SPDX-License-Identifier: Apache-2.0\n"));
}

}  // namespace
}  // namespace palpate
