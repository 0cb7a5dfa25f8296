// SPDX-License-Identifier: Apache-2.0
// palpate: launches sessions; every other command is in palpate_tools, which lies beside it and
// which it becomes. So a first launch waits for the compilation of the nodes and the launcher
// alone.
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/process/run_node.h"
#include "deploy/palpate/launch/launcher.h"

namespace palpate {
namespace {

/// The command is launch, or only the version is asked for.
bool is_for_the_launcher(int argc, char** argv) {
  bool asks_for_version = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (!word.starts_with('-')) return word == "launch";
    asks_for_version |= word == "--version";
  }
  return asks_for_version;
}

/// Returns only if it fails: the exit status.
int become_tools(char** argv) {
  const std::filesystem::path folder =
      std::filesystem::read_symlink("/proc/self/exe").parent_path();
  execv((folder / "palpate_tools").c_str(), argv);
  const std::string remedy =
      errno == ENOENT ? "build it (cmake --build build/release --target palpate_tools), or copy it "
                        "there if you have moved palpate"
                      : std::string("it does not start: ") + std::strerror(errno);
  std::fprintf(stderr, "palpate: commands other than launch need palpate_tools in %s; %s\n",
               folder.c_str(), remedy.c_str());
  return kExitSetupError;
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  if (!palpate::is_for_the_launcher(argc, argv)) return palpate::become_tools(argv);
  return palpate::run_launcher(argc, argv);
}
