// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include "common/link/security/keys.h"
#include "deploy/palpate/commands.h"

namespace palpate {
namespace {

int make_keys(const std::string& folder) {
  for (const auto& file : make_key_folder(folder)) std::printf("%s\n", file.c_str());
  std::printf(
      "Copy allowed.keys to every host, ROLE.key_secret only to the hosts of that role. A session\n"
      "names the folder, relative to its own file: security { key_folder: \"…\" }\n");
  return 0;
}

}  // namespace

Command add_keygen_command(CLI::App& app) {
  CLI::App& command = *app.add_subcommand(
      "keygen", "generate the keys for links between machines; never overwrites a key");
  auto folder = std::make_shared<std::string>();
  command.add_option("DIR", *folder, "folder for the keys; created if absent")
      ->required()
      ->type_name("");
  return {&command, [folder](const Verbosity&) { return make_keys(*folder); }};
}

}  // namespace palpate
