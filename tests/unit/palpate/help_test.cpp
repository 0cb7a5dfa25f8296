// SPDX-License-Identifier: Apache-2.0
// Help that is made from the definitions of commands and from the glossary.
#include "deploy/palpate/screen/help.h"
#include "deploy/palpate/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/nearest.h"
#include "common/task/score_table.h"
#include "deploy/study/folder.h"

namespace palpate {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

/// tool [-q] run SESSION [--csv FILE] [--seconds S] [--fast], tool scene check SESSION
struct Tool {
  Tool() {
    app.require_subcommand(1);
    app.fallthrough();
    app.add_flag("-q,--quiet", is_quiet, "print less");
    CLI::App& run = *app.add_subcommand("run", "run a session: it's fast");
    run.add_option("SESSION", file, "session file")->required()->type_name("");
    run.add_option("--csv", file, "write [a table]")->type_name("FILE");
    run.add_option("--seconds", file, ".5 or more")->type_name("S");
    run.add_flag("--fast", is_quiet, "be fast");
    CLI::App& scene = *app.add_subcommand("scene", "of a session");
    scene.require_subcommand(1);
    scene.add_subcommand("check", "check it");
  }
  /// What did_you_mean says after these arguments fail.
  std::string meant(std::vector<std::string> arguments) {
    std::reverse(arguments.begin(), arguments.end());
    EXPECT_THROW(app.parse(arguments), CLI::ParseError);
    return did_you_mean(app);
  }

  CLI::App app{"A tool.", "tool"};
  std::string file;
  bool is_quiet = false;
};

TEST(Nearest, PrefersBeginningsThenFewChanges) {
  EXPECT_EQ(nearest("mass", {"hash", "mass_kg"}), "mass_kg");
  EXPECT_EQ(nearest("lunch", {"loopback", "launch"}), "launch");
  EXPECT_EQ(nearest("zzzzzz", {"loopback", "launch"}), "");
  EXPECT_EQ(nearest("", {"launch"}), "");
  EXPECT_EQ(nearest("MOFC", {"none", "mofc"}), "mofc");
  EXPECT_EQ(nearest("jnd", {"Jitter", "JND"}), "JND");
}

TEST(DidYouMean, KnowsCommandsAndTheirOptions) {
  EXPECT_EQ(Tool().meant({"rum", "x"}), "rum: did you mean run?\n");
  EXPECT_EQ(Tool().meant({"scene", "chekc"}), "chekc: did you mean check?\n");
  EXPECT_EQ(Tool().meant({"run", "x", "--secconds", "3"}), "--secconds: did you mean --seconds?\n");
  EXPECT_EQ(Tool().meant({"run", "x", "--cvs=a"}), "--cvs: did you mean --csv?\n");
  EXPECT_EQ(Tool().meant({"run", "x", "--quite"}), "--quite: did you mean --quiet?\n");
  EXPECT_EQ(Tool().meant({"run"}), "") << "nothing is misspelt";
}

TEST(ManPage, HasEveryCommandAndOptionAsRoff) {
  const Tool tool;
  const std::string whole = man_page(tool.app, tool.app);
  EXPECT_THAT(whole, AllOf(HasSubstr(".TH TOOL 1"), HasSubstr("\\fBrun\\fR\nrun a session"),
                           HasSubstr("\\fBtool\\-run\\fR(1)"), HasSubstr("\\-q,\\-\\-quiet")));
  const std::string run = man_page(tool.app, *tool.app.get_subcommand("run"));
  EXPECT_THAT(run, AllOf(HasSubstr(".TH TOOL-RUN 1"), HasSubstr("\\fBtool run\\fR \\fISESSION\\fR"),
                         HasSubstr("\\fB\\-\\-csv\\fR \\fIFILE\\fR\nwrite [a table]"),
                         HasSubstr("\n\\&.5 or more"), HasSubstr("\\-q,\\-\\-quiet")));
}

TEST(Completion, HasEveryCommandAndOptionInEveryShell) {
  const Tool tool;
  for (const char* shell : {"bash", "zsh", "fish"}) {
    SCOPED_TRACE(shell);
    const std::string text = completion(tool.app, shell);
    for (const char* word : {"run", "scene", "check", "csv", "seconds", "fast", "quiet"}) {
      EXPECT_THAT(text, HasSubstr(word));
    }
    EXPECT_THAT(text, Not(HasSubstr("it's"))) << "the quote would end the text";
  }
  EXPECT_THROW(static_cast<void>(completion(tool.app, "csh")), SetupError);
}

TEST(Completion, HasTheValuesOfOptionsAndTheWordsOfArguments) {
  Tool tool;
  std::vector<std::string> nodes;
  const CLI::Validator values([](const std::string&) { return std::string(); }, "{device,mofc}");
  tool.app.get_subcommand("run")
      ->add_option("--nodes", nodes, "which")
      ->type_name("NODE")
      ->delimiter(',')
      ->check(values);
  tool.app.get_subcommand("run")->add_option("--only", tool.file, "one")->check(values);
  const ArgumentWords words{{"scene", {"left", "it's", "right-2"}}};
  const auto completed = [&](const char* shell) { return completion(tool.app, shell, {}, words); };
  EXPECT_THAT(completed("bash"), AllOf(HasSubstr("--nodes) words='device mofc' ;;"),
                                       HasSubstr("scene) words='left right-2 check")));
  EXPECT_THAT(completed("zsh"),
              AllOf(HasSubstr("[which]:NODE:_values -s , value device mofc'"),
                    HasSubstr("[one]:TEXT:(device mofc)'"), HasSubstr("'*:word:(left right-2)'")));
  EXPECT_THAT(completed("fish"),
              AllOf(HasSubstr("-l nodes -x -a '(__fish_append , device mofc)'"),
                    HasSubstr("-l only -x -a 'device mofc'"),
                    HasSubstr("__fish_seen_subcommand_from scene' -f -a 'left right-2'")));
}

TEST(Glossary, IsReadAsTermsWithoutMarks) {
  const auto entries = glossary_entries(
      "# Glossary\n## Terms\n\n| term | meaning |\n|---|---|\n"
      "| f_d, f_co | `Viscous` and *Coulomb* ([theory §2](theory.md#2)). |\n"
      "| age (of the force) | Time. |\n\n## CSV columns\n\n| column | meaning |\n|---|---|\n"
      "| `x_m` `y_m` | \\|position\\|, m |\n");
  ASSERT_THAT(entries, SizeIs(3));
  EXPECT_EQ(entries[0].meaning, "Viscous and Coulomb (theory §2).");
  EXPECT_THAT(entries[0].names, ElementsAre("f_d, f_co", "f_d", "f_co"));
  EXPECT_EQ(entries[2].meaning, "|position|, m");
  EXPECT_EQ(explain(entries, "Age").front().term, "age (of the force)");
  EXPECT_EQ(explain(entries, "y_m").front().section, "CSV columns");
  EXPECT_EQ(explain(entries, "of the force").front().term, "age (of the force)");
  EXPECT_THAT(explain(entries, "nonsense"), IsEmpty());
}

TEST(Glossary, ThatIsBuiltInExplainsWhatIsShown) {
  const auto entries = glossary_entries(glossary());
  for (const char* term : {"transparency", "clamp share", "f_co", "JND", "fe_x", "answered_ratio",
                           "node_up", "Z-width", "fallback"}) {
    EXPECT_THAT(explain(entries, term), Not(IsEmpty())) << term;
  }
  // of tasks and studies
  for (const char* term :
       {"smoothness", "coverage_ratio", "force_held", "within_ratio", "difference_ratio"}) {
    EXPECT_THAT(explain(entries, term), Not(IsEmpty())) << term;
  }
  std::istringstream columns(table_csv(std::vector<NamedScore>{}) + "," +
                             regions_csv(std::vector<NamedScore>{}) + "," +
                             study::Folder::header());
  for (std::string line; std::getline(columns, line);) {
    std::istringstream row(line);
    for (std::string column; std::getline(row, column, ',');) {
      EXPECT_TRUE(column.empty() || !explain(entries, column).empty()) << column;
    }
  }
  EXPECT_THAT(explain(entries, "smoothness").front().meaning, HasSubstr("jerk"));
  EXPECT_THAT(explain(entries, "force_held").front().meaning, testing::EndsWith("[N]"));
  for (const GlossaryEntry& entry : entries) {
    EXPECT_FALSE(entry.meaning.empty()) << entry.term;
    EXPECT_THAT(entry.meaning, Not(HasSubstr("](")));
  }
}

}  // namespace
}  // namespace palpate
