// SPDX-License-Identifier: Apache-2.0
// The documents name what the code has: functions of the equation map, columns and keys of outputs,
// sections and files that others refer to.
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

namespace palpate {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = test::source_dir();

using test::text_of;

std::vector<std::string> matches(const std::string& text, const char* pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator it(text.begin(), text.end(), regex), end; it != end; ++it) {
    found.push_back((*it)[1]);
  }
  return found;
}

/// Every `name` between backticks.
std::set<std::string> quoted_names(const std::string& text) {
  const auto found = matches(text, "`([A-Za-z0-9_]+)`");
  return {found.begin(), found.end()};
}

/// The part of a document from a heading to the next one of its level.
std::string section(const std::string& text, const std::string& heading) {
  const std::size_t begin = text.find("\n" + heading + "\n");
  if (begin == std::string::npos) return {};
  const std::string level = heading.substr(0, heading.find(' ') + 1);
  return text.substr(begin, text.find("\n" + level, begin + 1) - begin);
}

bool has_word(const std::string& text, const std::string& word) {
  return std::regex_search(text, std::regex("\\b" + word + "\\b"));
}

struct MappedFunction {
  std::string name;
  std::string file;
};

/// Rows `| equation | `function` | `file` |`.
std::vector<MappedFunction> equation_map(const std::string& theory) {
  static const std::regex row(R"(\|[^|]*\| `(\w+)` \| `([\w/.]+)` \|)");
  std::vector<MappedFunction> map;
  for (std::sregex_iterator it(theory.begin(), theory.end(), row), end; it != end; ++it) {
    map.push_back({(*it)[1], (*it)[2]});
  }
  return map;
}

TEST(EquationMap, NamesFunctionsThatExist) {
  const std::vector<MappedFunction> map = equation_map(text_of(kRoot / "docs/theory.md"));
  EXPECT_GE(map.size(), 15u);
  for (const MappedFunction& function : map) {
    const std::string source = text_of(kRoot / function.file);
    EXPECT_TRUE(has_word(source, function.name)) << function.name << " in " << function.file;
  }
}

TEST(EquationMap, TheScanReadsARow) {
  const auto map = equation_map("| (13) | `maximum_force_newton` | `a/b.h` |\n| no | row | |\n");
  ASSERT_EQ(map.size(), 1u);
  EXPECT_EQ(map[0].name, "maximum_force_newton");
  EXPECT_EQ(map[0].file, "a/b.h");
}

TEST(Glossary, HasEveryColumnOfTheCsv) {
  const std::string source = text_of(kRoot / "common/telemetry/csv_writer.cpp");
  const std::size_t begin = source.find("kHeader =");
  ASSERT_NE(begin, std::string::npos);
  const std::string header = source.substr(begin, source.find(';', begin) - begin);
  std::string columns;  // the literals, joined
  for (const std::string& literal : matches(header, "\"([^\"\\\\]*)")) columns += literal;

  const std::set<std::string> known =
      quoted_names(section(text_of(kRoot / "docs/glossary.md"), "## CSV columns"));
  const std::vector<std::string> names = matches(columns, "([a-z0-9_]+)");
  EXPECT_GE(names.size(), 26u);
  for (const std::string& name : names) EXPECT_TRUE(known.contains(name)) << name;
}

/// Keys that a source writes: json["key"] and {"key", value}.
std::vector<std::string> json_keys(const std::string& source) {
  std::vector<std::string> keys = matches(source, R"re(\["(\w+)"\])re");
  for (const std::string& key : matches(source, R"re(\{"(\w+)", )re")) keys.push_back(key);
  return keys;
}

/// Sources below a folder whose text has `mark`: wherever a later move puts them.
std::string sources_with(const fs::path& folder, const std::string& mark) {
  std::string all;
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder)) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string source = text_of(entry.path());
    if (source.find(mark) != std::string::npos) all += source;
  }
  return all;
}

TEST(Glossary, HasEveryKeyOfTheSummaries) {
  const std::string source = sources_with("common/telemetry", "ordered_json summary_json(") +
                             sources_with("deploy", "ordered_json launch_json(");
  const std::set<std::string> known =
      quoted_names(section(text_of(kRoot / "docs/glossary.md"), "## Keys of the JSON summary"));
  const std::vector<std::string> keys = json_keys(source);
  EXPECT_GE(keys.size(), 40u);
  for (const std::string& key : keys) EXPECT_TRUE(known.contains(key)) << key;
}

TEST(Glossary, HasEveryMetric) {
  const std::string source = sources_with("viewer_node", "\"palpate_\"");
  const std::set<std::string> known =
      quoted_names(section(text_of(kRoot / "docs/glossary.md"), "## Metrics"));
  const std::vector<std::string> names =
      matches(source, R"re(\.(?:gauge|counter|histogram)\(\s*"(\w+)")re");
  EXPECT_GE(names.size(), 35u);
  for (const std::string& name : names) EXPECT_TRUE(known.contains(name)) << name;
}

TEST(Glossary, TheScansFindKeysAndSections) {
  EXPECT_EQ(json_keys(R"(json["a"] = {{"b", 1}, {"c", 2}};)"),
            (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(quoted_names(section("# T\n## A\n`x`\n## B\n`y`\n", "## B")),
            (std::set<std::string>{"y"}));
}

// `Suite.Name` of a test in C++, `path: words` of another file below tests/.
TEST(Changelog, NamesTestsThatExist) {
  std::string sources;
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "tests")) {
    if (entry.path().extension() == ".cpp") sources += text_of(entry.path());
  }
  const std::set<std::string> defined = [&] {
    static const std::regex test(R"(\nTEST(?:_F|_P)?\((\w+),\s+(\w+)\))");
    std::set<std::string> names;
    for (std::sregex_iterator it(sources.begin(), sources.end(), test), end; it != end; ++it) {
      names.insert((*it)[1].str() + "." + (*it)[2].str());
    }
    return names;
  }();
  const std::string rows = section(text_of(kRoot / "CHANGELOG.md"), "### Tests that failed before");
  const std::vector<std::string> named = matches(rows, "`([A-Z]\\w+\\.\\w+)`");
  EXPECT_GE(named.size(), 80u);
  for (const std::string& name : named) EXPECT_TRUE(defined.contains(name)) << name;
  static const std::regex elsewhere("`([\\w./]+): ([^`]+)`");
  for (std::sregex_iterator it(rows.begin(), rows.end(), elsewhere), end; it != end; ++it) {
    const std::string text = text_of(kRoot / "tests" / (*it)[1].str());
    EXPECT_NE(text.find((*it)[2].str()), std::string::npos) << it->str();
  }
}

/// The anchor that a renderer makes of a heading.
std::string anchor_of(const std::string& heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '_' || c == '-' || byte >= 0x80U) {
      anchor += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

std::set<std::string> anchors_in(const std::string& document) {
  std::set<std::string> anchors;
  for (const std::string& heading : matches("\n" + document, "\n#+ ([^\n]+)")) {
    anchors.insert(anchor_of(heading));
  }
  return anchors;
}

/// Links of a document that lead nowhere: to a file or to a heading that does not exist.
std::vector<std::string> broken_links(const std::string& document, const fs::path& file) {
  std::vector<std::string> broken;
  std::vector<std::string> links = matches(document, R"(\]\(([^)\s]+)\))");
  for (const std::string& image : matches(document, "src(?:set)?=\"([^\"]+)\""))
    links.push_back(image);
  for (const std::string& link : links) {
    if (link.find("://") != std::string::npos) continue;
    const std::size_t hash = link.find('#');
    const std::string path = link.substr(0, hash);
    const fs::path target = path.empty() ? file : file.parent_path() / path;
    const bool is_there = fs::exists(target);
    const bool has_heading =
        hash == std::string::npos ||
        (is_there && anchors_in(text_of(target)).contains(link.substr(hash + 1)));
    if (!is_there || !has_heading) broken.push_back(link);
  }
  return broken;
}

TEST(Documents, LinksLeadSomewhere) {
  std::vector<fs::path> files{"README.md",
                              "THIRD_PARTY.md",
                              "CHANGELOG.md",
                              "CODE_OF_CONDUCT.md",
                              "CONTRIBUTING.md",
                              "SECURITY.md",
                              "deploy/README.md",
                              "tests/bench/README.md",
                              "deploy/systemd/README.md",
                              "viewer_node/web/README.md"};
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "docs")) {
    if (entry.path().extension() == ".md") files.push_back(fs::relative(entry.path(), kRoot));
  }
  EXPECT_GE(files.size(), 11u);
  for (const fs::path& file : files) {
    const std::vector<std::string> broken = broken_links(text_of(kRoot / file), kRoot / file);
    EXPECT_EQ(broken, std::vector<std::string>{}) << file;
  }
}

TEST(Documents, TheScanFindsABrokenLink) {
  const fs::path file = kRoot / "README.md";
  EXPECT_EQ(broken_links("[a](no_such_file.md) [b](docs/theory.md)", file).size(), 1u);
  EXPECT_EQ(broken_links("[a](docs/theory.md#no-such-heading)", file).size(), 1u);
  EXPECT_EQ(broken_links("# A b\n[a](docs/theory.md#8-literature)", file).size(), 0u);
}

/// Paths between backticks that begin with a folder of the root and do not exist.
std::vector<std::string> missing_paths(const std::string& document) {
  std::vector<std::string> missing;
  for (const std::string& path :
       matches(document,
               "`((?:common|device_node|mofc_node|physics_node|viewer_node|deploy|proto|"
               "tests|cmake|docs)/[\\w./-]*)`")) {
    if (!fs::exists(kRoot / path)) missing.push_back(path);
  }
  return missing;
}

TEST(Documents, PathsThatTheyNameExist) {
  std::vector<fs::path> files{kRoot / "README.md", kRoot / "tests/bench/README.md"};
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "docs")) {
    if (entry.path().extension() == ".md") files.push_back(entry.path());
  }
  for (const fs::path& file : files) {
    EXPECT_EQ(missing_paths(text_of(file)), std::vector<std::string>{}) << file;
  }
}

TEST(Documents, TheScanFindsAMissingPath) {
  EXPECT_EQ(missing_paths("`common/core/time.h` `common/no_such_file.h` `run.csv`"),
            std::vector<std::string>{"common/no_such_file.h"});
}

/// Folders with sources of their own that the table of folders does not name.
TEST(Documents, TheTreeExplainsEveryFolder) {
  const std::string tree = section(text_of(kRoot / "docs/design.md"), "## The tree");
  std::set<std::string> missing;
  for (const char* top : {"common", "device_node", "mofc_node", "physics_node", "viewer_node",
                          "deploy", "proto", "tests"}) {
    for (const auto& entry : fs::directory_iterator(kRoot / top)) {
      if (!entry.is_directory()) continue;
      const std::string folder = fs::relative(entry.path(), kRoot).string();
      // proto/palpate holds its version folder only
      const bool is_named = tree.find("`" + folder + "/") != std::string::npos;
      if (!is_named) missing.insert(folder);
    }
  }
  EXPECT_EQ(missing, std::set<std::string>{});
}

TEST(Documents, NameOneVersion) {
  const auto version_in = [](const char* file, const char* pattern) {
    const auto found = matches(text_of(kRoot / file), pattern);
    return found.empty() ? std::string("none") : found.front();
  };
  const std::string version = version_in("CMakeLists.txt", "project\\(palpate VERSION ([0-9.]+)");
  EXPECT_EQ(version_in("CITATION.cff", "\nversion: ([0-9.]+)"), version);
  EXPECT_EQ(version_in("physics_node/python/pyproject.toml", "\nversion = \"([0-9.]+)\""), version);
  EXPECT_EQ(version_in("CHANGELOG.md", "\n## ([0-9.]+)"), version);
}

// The versions of what the page bundles are those of its lock file.
TEST(Documents, NameTheBundledPackages) {
  const std::string lock = text_of(kRoot / "viewer_node/web/package-lock.json");
  const std::string bundled = section(text_of(kRoot / "THIRD_PARTY.md"), "## Bundled in the page");
  for (const char* package : {"three", "uplot", "@bufbuild/protobuf"}) {
    const std::size_t entry = lock.find("\"node_modules/" + std::string(package) + "\"");
    ASSERT_NE(entry, std::string::npos) << package;
    const std::string version = matches(lock.substr(entry), "\"version\": \"([^\"]+)\"").front();
    EXPECT_NE(bundled.find("| " + std::string(package) + " | " + version + " |"), std::string::npos)
        << package << " " << version;
  }
}

// The bounds are those of the Journal of Open Source Software.
TEST(Documents, ThePaperHasItsLengthAndItsReferences) {
  const std::string paper = text_of(kRoot / "docs/joss/paper.md");
  const std::size_t body = paper.find("\n---\n") + 5;
  std::istringstream words(paper.substr(body));
  const auto count = std::distance(std::istream_iterator<std::string>(words), {});
  EXPECT_GE(count, 250);
  EXPECT_LE(count, 1000);

  const auto cited = matches(paper.substr(body), "@([a-z0-9]+)");
  const auto listed = matches(text_of(kRoot / "docs/joss/paper.bib"), "\n?@[a-z]+\\{([a-z0-9]+),");
  EXPECT_GT(listed.size(), 5u);
  EXPECT_EQ(std::set<std::string>(cited.begin(), cited.end()),
            std::set<std::string>(listed.begin(), listed.end()));
}

/// Sections of docs/theory.md that sources refer to exist.
TEST(Documents, SectionsOfTheTheoryThatSourcesCiteExist) {
  const std::string theory = text_of(kRoot / "docs/theory.md");
  const auto headings = matches("\n" + theory, "\n#+ ([0-9.]+)\\.? ");
  std::set<std::string> sections;
  for (std::string number : headings) {
    if (number.ends_with('.')) number.pop_back();
    sections.insert(number);
  }
  std::size_t citations = 0;
  for (const char* top : {"common", "device_node", "mofc_node", "physics_node", "viewer_node",
                          "deploy", "proto", "tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cpp" && extension != ".proto") continue;
      for (std::string number : matches(text_of(entry.path()), "theory\\.md §([0-9.]+)")) {
        if (number.ends_with('.')) number.pop_back();
        ++citations;
        EXPECT_TRUE(sections.contains(number)) << entry.path() << " cites §" << number;
      }
    }
  }
  EXPECT_GT(citations, 10u);
}

}  // namespace
}  // namespace palpate
