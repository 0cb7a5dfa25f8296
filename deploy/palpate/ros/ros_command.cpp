// SPDX-License-Identifier: Apache-2.0
// palpate ros: becomes palpate_ros, the only program that knows DDS.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "deploy/palpate/commands.h"

namespace palpate {
namespace {

struct RosCommand {
  CLI::App* parser = nullptr;

  void add_to(CLI::App& app) {
    parser = &app;
    app.prefix_command();  // options are those of palpate_ros
    app.fallthrough(false);
    app.set_help_flag();
    app.footer(
        "  palpate ros --session FILE         a running session or a replay as topics\n"
        "  palpate ros physics …              a publisher of forces as physics: physics {\n"
        "                                     command: [\"palpate_ros\", \"physics\"] }\n"
        "  palpate ros device --session FILE  an arm as device: device { plugin {\n"
        "                                     library: \"palpate_ros_device.so\" … } }\n"
        "  palpate ros --help, palpate ros physics --help, palpate ros device --help   their "
        "options");
  }

  [[nodiscard]] int run() const {
    const std::filesystem::path program =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "palpate_ros";
    std::vector<std::string> words{"palpate_ros"};
    for (const std::string& word : parser->remaining()) words.push_back(word);
    std::vector<char*> arguments;
    arguments.reserve(words.size() + 1);
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    execv(program.c_str(), arguments.data());
    if (errno != ENOENT) {
      throw SetupError(program.string() + " does not start: " + std::strerror(errno));
    }
    throw SetupError(
        "ros: this build has no DDS; install cyclonedds-dev and cyclonedds-tools, and build with "
        "cmake -DPALPATE_ROS=ON (docs/operations/ros.md)");
  }
};

}  // namespace

Command add_ros_command(CLI::App& app) {
  return add_command<RosCommand>(
      app, "ros", "Exchange a running session with nodes of ROS 2, by DDS or a rosbridge server.");
}

}  // namespace palpate
