// SPDX-License-Identifier: Apache-2.0
// palpate_tools: every command of palpate, which starts it for all but launch. This file registers
// them (commands.h).
#include "deploy/palpate/command_line.h"

int main(int argc, char** argv) {
  using namespace palpate;
  return run_command_line(argc, argv, [](CLI::App& app) {
    return std::vector<Command>{
        add_launch_command(app),      add_loopback_command(app),   add_info_command(app),
        add_export_command(app),      add_replay_command(app),     add_report_command(app),
        add_score_command(app),       add_make_task_command(app),  add_cut_command(app),
        add_merge_command(app),       add_recover_command(app),    add_identify_command(app),
        add_scene_check_command(app), add_conform_command(app),    add_doctor_command(app),
        add_keygen_command(app),      add_make_organ_command(app), add_import_command(app),
        add_mesh_command(app),        add_sweep_command(app),      add_study_command(app),
        add_stations_command(app),    add_devices_command(app),    add_emulate_command(app),
        add_ros_command(app),         add_explain_command(app),    add_help_command(app),
        add_man_command(app),         add_completion_command(app)};
  });
}
