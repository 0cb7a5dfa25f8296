// palpate conform physics: what keeps the rules passes, each fault of wrong_physics is named.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/program.h"
#include "tests/support/text.h"

namespace palpate {
namespace {

using nlohmann::json;
using test::Program;
using test::TempFolder;

struct Report {
  int status = -1;
  std::map<std::string, bool> is_good;
  std::string text;
};

/// A run of the suite, whose findings go to a file.
class Conform {
 public:
  explicit Conform(const std::vector<std::string>& command) {
    std::vector<std::string> arguments{"conform", "physics", "--json",
                                       (folder_.path() / "found.json").string(), "--"};
    arguments.insert(arguments.end(), command.begin(), command.end());
    program_ = std::make_unique<Program>("palpate", arguments);
  }
  Report report() {
    Report report{.status = program_->wait(std::chrono::seconds(60)), .text = program_->out()};
    const std::filesystem::path file = folder_.path() / "found.json";
    if (!std::filesystem::exists(file)) return report;
    const json found = json::parse(test::text_of(file));
    for (const json& one : found.at("findings")) {
      report.is_good[one.at("check").get<std::string>()] = one.at("is_good").get<bool>();
    }
    return report;
  }
  [[nodiscard]] std::string err() const { return program_->err(); }

 private:
  TempFolder folder_;
  std::unique_ptr<Program> program_;
};

std::string bin(const char* name) { return std::string(PALPATE_BINARY_DIR "/") + name; }

TEST(ConformPhysics, AProgramThatCannotBeStartedIsNamedAfterOptionsWithSeveralValues) {
  Program conform("palpate", {"conform", "physics", "--press", "0", "0", "-0.004", "--", "./none",
                              "--session", "{session}"});
  EXPECT_EQ(conform.wait(), 2);
  EXPECT_EQ(conform.err(),
            "palpate conform: physics.command: " + std::filesystem::absolute("./none").string() +
                ": is not a program that you may run; install it, or give the path "
                "of its file\n");
}

TEST(ConformPhysics, OurOwnPhysicsPassesEveryCheck) {
  Conform run({bin("physics_node"), "--session", "{session}"});
  const Report report = run.report();
  EXPECT_EQ(report.status, 0) << report.text << run.err();
  EXPECT_GE(report.is_good.size(), 13U);
}

// One fault each; all at once, as they mostly wait.
TEST(ConformPhysics, NamesEachFault) {
  const std::map<std::string, std::string> check_of{
      {"start", "start"}, {"silence", "silence"}, {"answers", "answers"}, {"rest", "rest"},
      {"air", "rest"},    {"jumps", "jumps"},     {"energy", "energy"},   {"stamps", "stamps"},
      {"pose", "stamps"}, {"frames", "frames"},   {"delay", "delay"},     {"restart", "restart"},
      {"stop", "stop"}};
  std::map<std::string, std::unique_ptr<Conform>> runs;
  for (const auto& [fault, check] : check_of) {
    runs[fault] = std::make_unique<Conform>(
        std::vector<std::string>{bin("wrong_physics"), fault, "--session", "{session}"});
  }
  for (auto& [fault, run] : runs) {
    const Report report = run->report();
    EXPECT_EQ(report.status, 1) << fault << "\n" << report.text << run->err();
    const auto found = report.is_good.find(check_of.at(fault));
    ASSERT_NE(found, report.is_good.end()) << fault << "\n" << report.text << run->err();
    EXPECT_FALSE(found->second) << fault << "\n" << report.text;
  }
}

TEST(ConformPhysics, RefusesAProgramThatIsNotThere) {
  Conform run({"./no_such_physics"});
  EXPECT_EQ(run.report().status, 2);
  EXPECT_NE(run.err().find("no_such_physics"), std::string::npos) << run.err();
}

}  // namespace
}  // namespace palpate
