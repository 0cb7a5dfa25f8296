// SPDX-License-Identifier: Apache-2.0
// refresh_figures — rewrites the tables of figures in README.md and docs/ from the output of the
// programs that make them, or checks that they still agree.
//
// A table stands between two markers, below a line that says where it is from:
//
//   <!-- figures: NAME -->
//   *`command`; date; machine*
//
//   | the table |
//   <!-- end -->
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/doc_figures.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBegin = "<!-- figures: ";
constexpr const char* kEnd = "<!-- end -->";

struct Options {
  fs::path root = test::source_dir();
  bool is_check = false;
  std::vector<std::string> only;
};

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::array<char, 16> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d", std::gmtime(&now));
  return text.data();
}

/// The processor, how many of them, and the compiler.
std::string machine() {
  std::string model = "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    model = line.substr(line.find(':') + 2);
    break;
  }
  return model + ", " + std::to_string(std::thread::hardware_concurrency()) +
         " processors, GCC-compatible compiler " __VERSION__;
}

/// Runs a command of the build folder in the root of the repository. Returns its JSON.
nlohmann::json output_of(const std::string& command) {
  const fs::path json_file =
      fs::temp_directory_path() / ("palpate_figures_" + std::to_string(::getpid()) + ".json");
  const std::string line = "cd '" + test::source_dir() + "' && '" + test::binary_dir() + "'/" +
                           command + " --json '" + json_file.string() + "' > /dev/null";
  const int status = std::system(line.c_str());
  const std::string text = text_of(json_file);
  fs::remove(json_file);
  if (status != 0)
    throw SetupError("figures: " + command + " failed; build it, and see its message");
  return nlohmann::json::parse(text);
}

/// @param[in,out] known the output of each command that has run
std::string new_table(const DocFigures& figures, std::map<std::string, nlohmann::json>& known) {
  std::vector<nlohmann::json> outputs;
  for (const std::string& command : figures.commands) {
    if (!known.contains(command)) {
      std::printf("running %s\n", command.c_str());
      std::fflush(stdout);
      known[command] = output_of(command);
    }
    outputs.push_back(known[command]);
  }
  return figures.table(outputs);
}

/// README.md and the documents, in a fixed order.
std::vector<fs::path> documents(const fs::path& root) {
  std::vector<fs::path> files{root / "README.md"};
  for (const auto& entry : fs::recursive_directory_iterator(root / "docs")) {
    if (entry.path().extension() == ".md") files.push_back(entry.path());
  }
  std::sort(files.begin() + 1, files.end());
  return files;
}

/// One marked table of a document.
struct Block {
  std::string name;
  std::size_t caption_begin = 0;
  std::size_t table_begin = 0;
  std::size_t table_end = 0;  // where the end marker begins
};

std::vector<Block> blocks_of(const std::string& text, const fs::path& file) {
  std::vector<Block> blocks;
  const auto refuse = [&](const std::string& why) {
    throw SetupError(file.string() + ": " + why + ": write " + kBegin +
                     "NAME -->, a line *command; date; machine*, an empty line, the table, " +
                     kEnd);
  };
  const std::string begin = kBegin;
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) {
    const std::size_t name_end = text.find(" -->\n", at);
    const std::size_t end = text.find(kEnd, at);
    if (name_end == std::string::npos || name_end > end) {
      refuse("a marker of figures without a name");
    }
    if (end == std::string::npos || text.find(begin, at + 1) < end) {
      refuse("a marker of figures without its end");
    }
    const std::size_t caption = text.find('\n', at) + 1;
    const std::size_t caption_end = text.find("*\n\n", caption);
    if (caption_end == std::string::npos || caption_end > end) {
      refuse("figures that do not say where they are from");
    }
    blocks.push_back({text.substr(at + begin.size(), name_end - at - begin.size()), caption,
                      caption_end + 3, end});
  }
  return blocks;
}

bool is_wanted(const DocFigures& figures, const Options& options) {
  if (!options.only.empty()) {
    return std::find(options.only.begin(), options.only.end(), figures.name) != options.only.end();
  }
  if (figures.is_of_real_time) return false;
  return figures.is_checked || !options.is_check;
}

/// The first line in which two tables differ.
std::string first_difference(const std::string& documented, const std::string& measured) {
  std::istringstream old_lines(documented);
  std::istringstream new_lines(measured);
  std::string old_line;
  std::string new_line;
  do {
    old_line.clear();
    new_line.clear();
    std::getline(old_lines, old_line);
    std::getline(new_lines, new_line);
  } while (old_line == new_line && (old_lines || new_lines));
  return "  documented: " + old_line + "\n  measured:   " + new_line + "\n";
}

/// Exit status: 0, or 1 if a documented figure no longer agrees.
int refresh(const Options& options) {
  const std::vector<DocFigures> all = doc_figures();
  std::map<std::string, std::string> tables;  // by name, made when first needed
  std::map<std::string, nlohmann::json> outputs;
  int status = 0;
  std::map<std::string, int> uses;
  for (const fs::path& file : documents(options.root)) {
    std::string text = text_of(file);
    const std::string before = text;
    std::vector<Block> blocks = blocks_of(text, file);
    std::reverse(blocks.begin(), blocks.end());  // from the back: the places before stay valid
    for (const Block& block : blocks) {
      const auto figures = std::find_if(all.begin(), all.end(),
                                        [&](const DocFigures& f) { return f.name == block.name; });
      if (figures == all.end()) {
        throw SetupError(file.string() + ": figures \"" + block.name +
                         "\" are not known to tests/bench/doc_figures.cpp");
      }
      ++uses[block.name];
      if (!is_wanted(*figures, options)) continue;
      if (!tables.contains(block.name)) {
        tables[block.name] = new_table(*figures, outputs);
      }
      const std::string& table = tables[block.name];
      const std::string documented =
          text.substr(block.table_begin, block.table_end - block.table_begin);
      if (options.is_check) {
        if (documented == table) continue;
        status = 1;
        std::printf("%s: figures \"%s\" no longer agree; run tests/bench/refresh %s\n%s",
                    file.string().c_str(), block.name.c_str(), block.name.c_str(),
                    first_difference(documented, table).c_str());
        continue;
      }
      std::string caption = "*`" + figures->shown_commands() + "`; " + today() + "; " + machine();
      if (figures->is_of_real_time) caption += ", load average " + machine_load();
      caption += "*\n\n";
      text.replace(block.caption_begin, block.table_end - block.caption_begin, caption + table);
    }
    if (text != before) {
      write_file(file, text);
      std::printf("rewritten: %s\n", file.string().c_str());
    }
  }
  for (const DocFigures& figures : all) {
    if (uses[figures.name] > 0) continue;
    status = 1;
    std::printf("figures \"%s\" stand in no document\n", figures.name.c_str());
  }
  return status;
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Rewrites the tables of figures in README.md and docs/, or checks them.");
  palpate::bench::Options options;
  app.add_flag("--check", options.is_check,
               "change nothing; exit status 1 if a table of the short lockstep figures differs");
  app.add_option("--root", options.root, "folder with the README.md and docs/ to rewrite or check")
      ->capture_default_str();
  app.add_option("names", options.only, "only these tables");
  CLI11_PARSE(app, argc, argv);
  try {
    return palpate::bench::refresh(options);
  } catch (const palpate::SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
