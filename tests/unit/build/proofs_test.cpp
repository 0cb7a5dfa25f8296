// SPDX-License-Identifier: Apache-2.0
// The lemmas of docs/proofs, by two solvers, and the functions that rely on them.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <ostream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"
#include "tests/unit/build/source_tree.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

const fs::path kSourceTree = test::source_dir();

/// One file: declarations and assertions, one a line, some of them marked at the end of the line.
struct Lemma {
  std::string name;
  std::vector<std::string> lines;
};

/// gtest names a row by this.
void PrintTo(const Lemma& lemma, std::ostream* out) { *out << lemma.name; }

bool is_hint(const std::string& line) { return line.ends_with("; hint"); }
bool is_twin(const std::string& line) { return line.ends_with("; dropped in the twin"); }
bool is_conclusion(const std::string& line) { return line.ends_with("; negated conclusion"); }

std::vector<Lemma> lemmas() {
  std::vector<Lemma> found;
  for (const std::string& file : test::tracked_files()) {
    if (!file.starts_with("docs/proofs/") || !file.ends_with(".smt2")) continue;
    Lemma lemma{.name = fs::path(file).stem().string(), .lines = {}};
    std::ifstream in(kSourceTree / file);
    for (std::string line; std::getline(in, line);) lemma.lines.push_back(line);
    found.push_back(lemma);
  }
  return found;
}

/// The lemma without its hints and without the assumption that the twin lacks, with a model.
std::string twin_of(const Lemma& lemma) {
  static const std::regex constant(R"(\(declare-const (\w+) Real\))");
  std::string text = "(set-option :produce-models true)\n";
  std::string constants;
  for (const std::string& line : lemma.lines) {
    if (is_hint(line) || is_twin(line)) continue;
    text += line + '\n';
    std::smatch name;
    if (std::regex_search(line, name, constant)) constants += " " + name[1].str();
  }
  return text + "(get-value (" + constants + "))\n";
}

std::string text_of(const Lemma& lemma) {
  std::string text;
  for (const std::string& line : lemma.lines) text += line + '\n';
  return text;
}

/// What is assumed, and that the hint in line `hint` is false; earlier hints may help.
std::string refuted_hint(const Lemma& lemma, std::size_t hint) {
  std::string text;
  for (std::size_t i = 0; i < lemma.lines.size(); ++i) {
    const std::string& line = lemma.lines[i];
    if (is_conclusion(line) || (is_hint(line) && i > hint)) continue;
    if (i != hint) {
      text += line + '\n';
      continue;
    }
    const std::size_t begin = std::string("(assert ").size();
    text += "(assert (not " + line.substr(begin, line.rfind(")  ; hint") - begin) + "))\n";
  }
  return text;
}

struct Answer {
  std::string verdict;  ///< sat, unsat; else out of time
  std::string values;   ///< of a sat
  double ms = 0.0;
};

constexpr int kSeconds = 20;

Answer solve(const std::string& solver, const std::string& problem) {
  const test::TempFolder folder;
  const fs::path file = folder.path() / "problem.smt2";
  std::ofstream(file) << problem;
  const std::string limit = solver == "z3" ? "-T:" + std::to_string(kSeconds)
                                           : "--tlimit=" + std::to_string(1000 * kSeconds);
  const auto start = std::chrono::steady_clock::now();
  const std::string output = test::run_command(solver + " " + limit + " " + file.string()).output;
  Answer answer;
  answer.ms = 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  answer.verdict = output.substr(0, output.find(' '));
  if (answer.verdict == "sat") answer.values = output.substr(output.find(' ') + 1);
  if (answer.verdict != "sat" && answer.verdict != "unsat") answer.verdict = "out of time";
  return answer;
}

bool has_solvers() {
  return test::run_command("z3 --version").status == 0 &&
         test::run_command("cvc5 --version").status == 0;
}

class Proofs : public testing::TestWithParam<Lemma> {
 protected:
  void SetUp() override {
    if (!has_solvers()) GTEST_SKIP() << "needs z3 and cvc5: deploy/packages.sh --tests";
  }
};

// Prints a row of the table in docs/theory.md §9.
TEST_P(Proofs, TheConclusionFollowsAndNeedsItsAssumptions) {
  const Lemma& lemma = GetParam();
  const Answer z3 = solve("z3", text_of(lemma));
  const Answer cvc5 = solve("cvc5", text_of(lemma));
  EXPECT_NE(z3.verdict, "sat");
  EXPECT_NE(cvc5.verdict, "sat");
  EXPECT_TRUE(z3.verdict == "unsat" || cvc5.verdict == "unsat") << "no solver proves it in time";

  Answer twin = solve("z3", twin_of(lemma));
  if (twin.verdict != "sat") twin = solve("cvc5", twin_of(lemma));
  EXPECT_EQ(twin.verdict, "sat") << "the conclusion does not need the assumption marked as dropped";
  std::printf("%s: z3 %s %.0f ms, cvc5 %s %.0f ms; twin: %s\n", lemma.name.c_str(),
              z3.verdict.c_str(), z3.ms, cvc5.verdict.c_str(), cvc5.ms, twin.values.c_str());
}

TEST_P(Proofs, HintsFollowFromTheAssumptions) {
  const Lemma& lemma = GetParam();
  for (std::size_t i = 0; i < lemma.lines.size(); ++i) {
    if (!is_hint(lemma.lines[i])) continue;
    Answer answer = solve("z3", refuted_hint(lemma, i));
    if (answer.verdict != "unsat") answer = solve("cvc5", refuted_hint(lemma, i));
    EXPECT_EQ(answer.verdict, "unsat") << lemma.lines[i];
  }
}

TEST_P(Proofs, AreWellFormed) {
  const Lemma& lemma = GetParam();
  int twins = 0;
  int conclusions = 0;
  for (const std::string& line : lemma.lines) {
    twins += is_twin(line) ? 1 : 0;
    conclusions += is_conclusion(line) ? 1 : 0;
  }
  EXPECT_EQ(twins, 1);
  EXPECT_EQ(conclusions, 1);
  EXPECT_TRUE(lemma.lines.front().starts_with("; " + lemma.name + ": theory §"))
      << "begins with its name and place";
}

INSTANTIATE_TEST_SUITE_P(Lemma, Proofs, testing::ValuesIn(lemmas()),
                         [](const auto& row) { return row.param.name; });

TEST(Proofs, ASolverThatFindsACounterexampleIsHeard) {
  if (!has_solvers()) GTEST_SKIP() << "needs z3 and cvc5: deploy/packages.sh --tests";
  const std::string wrong =
      "(set-logic QF_LRA)\n(declare-const x Real)\n(assert (> x 0))\n(check-sat)\n";
  EXPECT_EQ(solve("z3", wrong).verdict, "sat");
  EXPECT_EQ(solve("cvc5", wrong).verdict, "sat");
}

/// "Lemmas: a, b." in the comments of the sources: by lemma, the files.
std::map<std::string, std::set<std::string>> tags_in_sources() {
  static const std::regex tag(R"(Lemmas?:[ \n/]+([a-z_, \n/]+)\.)");
  static const std::regex name(R"([a-z_]{3,})");
  std::map<std::string, std::set<std::string>> tags;
  for (const std::string& file : test::sources_below({"common", "mofc_node", "device_node"})) {
    std::ifstream in(kSourceTree / file);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    for (std::sregex_iterator it(text.begin(), text.end(), tag), end; it != end; ++it) {
      const std::string list = (*it)[1];
      for (std::sregex_iterator each(list.begin(), list.end(), name), none; each != none; ++each) {
        tags[each->str()].insert(file);
      }
    }
  }
  return tags;
}

// Rows | `lemma` | … | `function` | `file` | … of docs/theory.md §9.
TEST(Lemmas, StandAtTheFunctionsThatRelyOnThem) {
  static const std::regex row(R"(\n\| `(\w+)` \|[^|]*\| `([\w:]+)` \| `([\w/.]+)` \|)");
  std::ifstream in(kSourceTree / "docs/theory.md");
  const std::string theory{std::istreambuf_iterator<char>(in), {}};
  const auto tags = tags_in_sources();

  std::set<std::string> in_table;
  for (std::sregex_iterator it(theory.begin(), theory.end(), row), end; it != end; ++it) {
    const std::string lemma = (*it)[1];
    const std::string file = (*it)[3];
    in_table.insert(lemma);
    const auto found = tags.find(lemma);
    ASSERT_NE(found, tags.end()) << lemma << " stands at no function";
    EXPECT_TRUE(found->second.contains(file)) << lemma << " in " << file;
    std::ifstream source(kSourceTree / file);
    const std::string text{std::istreambuf_iterator<char>(source), {}};
    EXPECT_NE(text.find((*it)[2].str()), std::string::npos) << (*it)[2] << " in " << file;
  }
  std::set<std::string> in_folder;
  for (const Lemma& lemma : lemmas()) in_folder.insert(lemma.name);
  std::set<std::string> in_code;
  for (const auto& [lemma, files] : tags) in_code.insert(lemma);
  EXPECT_EQ(in_table, in_folder);
  EXPECT_EQ(in_code, in_folder);
  EXPECT_GE(in_folder.size(), 15u);
}

/// `TEST(Suite, Name` and the like in the tests: "Suite.Name".
std::set<std::string> names_of_tests() {
  static const std::regex test(R"(\bTEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\))");
  std::set<std::string> names;
  for (const std::string& file : test::sources_below({"tests"})) {
    std::ifstream in(kSourceTree / file);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    for (std::sregex_iterator it(text.begin(), text.end(), test), end; it != end; ++it) {
      names.insert((*it)[1].str() + "." + (*it)[2].str());
    }
  }
  return names;
}

// Rows | `lemma` | ms | ms | counterexample | `Suite.Test` | of docs/theory.md §9.
TEST(Lemmas, HaveTimesACounterexampleAndATestThatExists) {
  static const std::regex row(
      R"(\n\| `(\w+)` \| (\d+) \| (\d+) \| (\w+ [^|]+) \| `(\w+\.\w+)` \|)");
  std::ifstream in(kSourceTree / "docs/theory.md");
  const std::string theory{std::istreambuf_iterator<char>(in), {}};
  const std::set<std::string> tests = names_of_tests();
  EXPECT_TRUE(tests.contains("Lemmas.HaveTimesACounterexampleAndATestThatExists"));

  std::set<std::string> in_table;
  for (std::sregex_iterator it(theory.begin(), theory.end(), row), end; it != end; ++it) {
    in_table.insert((*it)[1]);
    EXPECT_TRUE(tests.contains((*it)[5])) << (*it)[5];
  }
  std::set<std::string> in_folder;
  for (const Lemma& lemma : lemmas()) in_folder.insert(lemma.name);
  EXPECT_EQ(in_table, in_folder);
}

}  // namespace
}  // namespace palpate
