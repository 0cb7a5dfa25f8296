// viewer_node: shows what the nodes of a session publish; reads only.
// All logic is in the library; this file only connects it to the world.
#include "viewer_node/process.h"

int main(int argc, char** argv) {
  palpate::viewer::ViewerOptions options;
  return palpate::run_node(
      argc, argv,
      {.name = "viewer",
       .description = "Shows a running session: a status line, and one CSV row per device tick.",
       .add_options =
           [&](CLI::App& app) {
             app.add_option("--csv", options.csv_file, "write one row per device tick to this file")
                 ->type_name("FILE");
             app.add_flag("--quiet", options.is_quiet, "no status line");
           }},
      [&](palpate::NodeContext& context) {
        palpate::ProcessLinks links({.priority = 0, .cpu = -1});
        palpate::viewer::run_process(context, links, options);
      });
}
