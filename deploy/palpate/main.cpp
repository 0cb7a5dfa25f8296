// palpate: runs and checks deployments.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/regular_file.h"
#include "common/core/version.h"
#include "common/link/security/keys.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "deploy/palpate/doctor.h"
#include "deploy/palpate/identify.h"
#include "deploy/palpate/json_output.h"
#include "deploy/palpate/launch_command.h"
#include "deploy/palpate/loopback.h"
#include "deploy/palpate/organ.h"
#include "deploy/palpate/recording_commands.h"
#include "viewer_node/recording/recording_file.h"
#include "viewer_node/recording/replay.h"
#include "viewer_node/recording/report.h"
#include "common/telemetry/summary.h"
#include "physics_node/files/ply.h"
#include "physics_node/scene/scene.h"
#include "physics_node/files/tetrahedral_files.h"

namespace {

using namespace palpate;

void add_time_option(CLI::App& app, std::optional<double>& seconds, const std::string& help) {
  app.add_option("--seconds", seconds, help)->type_name("S")->check(is_time());
}

void add_output_options(CLI::App& app, std::string& csv_file, std::string& json_file,
                        const std::string& more_on_csv = {}) {
  app.add_option("--csv", csv_file, "write one row per device tick to this file" + more_on_csv)
      ->type_name("FILE");
  app.add_option("--json", json_file, "write the summary to this file; - for standard output")
      ->type_name("FILE");
}

void add_record_options(CLI::App& app, viewer::RecordOptions& record) {
  app.add_option("--record", record.file,
                 "record every tick, the scene and the session to this MCAP file")
      ->type_name("FILE");
  app.add_flag("--overwrite", record.may_overwrite, "--record may replace a file");
}

/// What every subcommand takes.
void add_session_options(CLI::App& app, std::string& file, std::vector<std::string>& overrides) {
  app.add_option("SESSION", file, "session file (*.txtpb)")->required()->type_name("");
  app.add_option("--set", overrides,
                 "override a field of the session, e.g. mofc.controller=none; repeatable")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
}

struct SessionArguments {
  std::string file;
  std::vector<std::string> overrides;

  void add_to(CLI::App& app) { add_session_options(app, file, overrides); }
  [[nodiscard]] Session load() const { return load_session(file, overrides); }
};

void check_scene(const SessionArguments& arguments) {
  const Session session = arguments.load();
  static_cast<void>(physics::Scene(session.scene));  // reads the files of its geometries
  for (const Side& side : session.sides) {
    std::printf("%s: ok (%s%zu tissues, device %g Hz, physics %g Hz, controller %s)\n",
                arguments.file.c_str(), side.name.empty() ? "" : (side.name + ", ").c_str(),
                session.scene.tissues.size(), side.device.rate_hz, session.physics.rate_hz,
                controller_text(side.mofc).c_str());
  }
}

void add_side_option(CLI::App& app, std::string& side) {
  app.add_option("--side", side, "of a session or recording with several devices: which one")
      ->type_name("NAME");
}

struct IdentifyArguments {
  SessionArguments session;
  std::string side;
  IdentifyOptions options;

  void add_to(CLI::App& app) {
    session.add_to(app);
    add_side_option(app, side);
    app.add_option("--output", options.profile_file,
                   "write the bounds to this file, for device.profile_file of a session");
    app.add_flag("--i-understand-this-moves-the-device", options.may_move_hardware,
                 "needed for a real device: it moves by itself, with up to 1 N");
  }

  void run() const {
    // the profile that is to be written need not exist
    std::vector<std::string> overrides = session.overrides;
    overrides.emplace_back("device.profile_file=");
    run_identify(with_only_side(load_session(session.file, overrides), side), options);
  }
};

struct LoopbackArguments {
  SessionArguments session;
  std::string side;
  std::optional<double> seconds;
  std::string csv;
  std::string json;
  viewer::RecordOptions record;
  std::string hand;
  bool has_no_ideal = false;
  bool is_inproc = false;

  void add_to(CLI::App& app) {
    session.add_to(app);
    add_side_option(app, side);
    add_time_option(app, seconds, "simulated time in s (default: the session's duration_s)");
    add_output_options(app, csv, json);
    add_record_options(app, record);
    app.add_option("--hand", hand,
                   "the hand means to go where the recorded one meant to, as far as its motion and "
                   "the force on it tell; for as long as it was recorded, without --seconds")
        ->type_name("FILE.mcap");
    app.add_flag("--no-ideal", has_no_ideal,
                 "skip the ideal force and the ideal run, and the figures that need them");
    app.add_flag("--inproc", is_inproc, "carry the messages over ZeroMQ inproc instead of memory");
  }

  void run() const {
    // tissue gives way to each tool by itself, so one side alone feels what it feels beside others
    Session loaded = with_only_side(session.load(), side);
    refuse_shared_file(
        {{"--csv", csv}, {"--json", json}, {"--record", record.file}, {"--hand", hand}});
    std::optional<double> length_s = seconds;
    if (!hand.empty()) {
      RecordingFile recording(hand);
      recording.choose_side(side);
      RecordedPath path = hand_path_of(recording, loaded.side().hand);
      if (!length_s) length_s = recording.length_s();
      loaded.side().hand.path = std::move(path);
    }
    const JsonOutput json_output(json);
    const RunReport report = run_loopback(
        loaded, {.seconds = length_s,
                 .csv_file = csv,
                 .record = record,
                 .recorded_by = "palpate loopback" + (hand.empty() ? "" : " --hand " + hand),
                 .lockstep = {.links = is_inproc ? LockstepLinks::kInproc : LockstepLinks::kMemory,
                              .has_ideal = !has_no_ideal}});
    if (!json_output.is_standard_output()) {
      std::fputs(summary_text(loaded, report).c_str(), stdout);
    }
    json_output.write(summary_json(loaded, report));
  }
};

struct OrganArguments {
  std::string cloud_file;
  std::string mesh_file;
  std::uint32_t points = 3000;
  std::uint32_t subdivisions = 2;

  void add_to(CLI::App& app) {
    app.add_option("--cloud", cloud_file, "write its points to this file (PLY)")->type_name("FILE");
    app.add_option("--points", points, "how many (default 3000)")
        ->type_name("N")
        ->check(CLI::Range(10, 100'000'000));
    app.add_option("--mesh", mesh_file, "write its tetrahedra to this file (Gmsh 2.2)")
        ->type_name("FILE");
    app.add_option("--subdivisions", subdivisions, "of the mesh (default 2: 2240 tetrahedra)")
        ->type_name("N")
        ->check(CLI::Range(0, 6));
  }

  void run() const {
    const auto write = [](const std::string& file, const std::string& text) {
      std::ofstream out(file, std::ios::binary);
      out << text;
      out.close();
      if (!out) throw SetupError(file + ": cannot be written; choose another place");
    };
    if (cloud_file.empty() && mesh_file.empty()) {
      throw SetupError("make-organ: nothing to write; give --cloud FILE or --mesh FILE");
    }
    if (!cloud_file.empty()) write(cloud_file, physics::ply_text(organ_cloud(points)));
    if (!mesh_file.empty()) write(mesh_file, physics::msh_text(organ_mesh(subdivisions)));
  }
};

struct DoctorArguments {
  std::string file;
  std::vector<std::string> overrides;

  void add_to(CLI::App& app) {
    add_session_options(app, file, overrides);
    app.get_option("SESSION")->required(false)->description(
        "look at its rate, links, ports and keys too");
  }
  /// @return exit status
  [[nodiscard]] int run() const {
    std::optional<Session> session;
    if (!file.empty()) session = load_session(file, overrides);
    const std::vector<Finding> findings = examine_machine(session);
    std::fputs(findings_text(findings).c_str(), stdout);
    const bool is_well = std::all_of(findings.begin(), findings.end(),
                                     [](const Finding& f) { return f.remedy.empty(); });
    return is_well ? 0 : kExitFailure;
  }
};

struct KeygenArguments {
  std::string folder;

  void add_to(CLI::App& app) {
    app.add_option("DIR", folder, "folder for the keys; made if it is absent")
        ->required()
        ->type_name("");
  }
  void run() const {
    for (const auto& file : make_key_folder(folder)) std::printf("%s\n", file.c_str());
    std::printf(
        "allowed.keys goes to every host, ROLE.key_secret only to the hosts of that role. A "
        "session\n"
        "names the folder, as seen from its own file: security { key_folder: \"…\" }\n");
  }
};

struct InfoArguments {
  std::string file;
  bool is_json = false;

  void add_to(CLI::App& app) {
    app.add_option("FILE", file, "recording (*.mcap)")->required()->type_name("");
    app.add_flag("--json", is_json, "as JSON");
  }
  void run() const {
    RecordingFile recording(file);
    const std::string text = is_json ? info_json(recording).dump(2) + "\n" : info_text(recording);
    std::fputs(text.c_str(), stdout);
  }
};

struct ExportArguments {
  std::string file;
  std::string side;
  std::string csv;

  void add_to(CLI::App& app) {
    app.add_option("FILE", file, "recording (*.mcap)")->required()->type_name("");
    add_side_option(app, side);
    app.add_option("--csv", csv, "one row per device tick, columns as of launch and loopback")
        ->required()
        ->type_name("FILE");
  }
  void run() const {
    refuse_shared_file({{"FILE", file}, {"--csv", csv}});
    RecordingFile recording(file);
    recording.choose_side(side);
    export_csv(recording, csv);
  }
};

struct ReportArguments {
  std::string file;
  std::string side;
  std::string output;

  void add_to(CLI::App& app) {
    app.add_option("FILE", file, "recording (*.mcap)")->required()->type_name("");
    add_side_option(app, side);
    app.add_option("-o,--output", output, "one HTML file that needs no other")
        ->required()
        ->type_name("FILE");
  }
  void run() const {
    refuse_shared_file({{"FILE", file}, {"--output", output}});
    RecordingFile recording(file);
    recording.choose_side(side);
    write_report(recording, output);
  }
};

void add_replay_options(CLI::App& app, ReplayOptions& replay) {
  const CLI::Validator is_start(
      [](const std::string& text) {
        double seconds = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, seconds);
        return is_number && seconds >= 0.0 && seconds <= 1e9
                   ? std::string()
                   : "\"" + text + "\": give a time in s, at least 0";
      },
      "", "start");
  app.add_option("FILE", replay.file, "recording (*.mcap)")->required()->type_name("");
  app.add_option("--session", replay.session_file,
                 "publish where this session's viewers look (default: the recorded session)")
      ->type_name("FILE");
  app.add_option("--set", replay.overrides, "override a field of the session; repeatable")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  app.add_option("--speed", replay.speed_ratio, "times real time (default: 1)")
      ->type_name("RATIO")
      ->check(CLI::Range(0.001, 1000.0));
  app.add_option("--start", replay.start_s, "begin so far into the recording")
      ->type_name("S")
      ->check(is_start);
  app.add_flag("--loop", replay.loops, "again and again, until Ctrl-C");
  app.add_flag("--insecure", replay.is_insecure, "tcp beyond loopback without keys");
}

void add_launch_options(CLI::App& app, LaunchCommand& launch) {
  add_session_options(app, launch.session_file, launch.overrides);
  add_time_option(app, launch.seconds, "stop after this time in s (default: run until Ctrl-C)");
  add_output_options(app, launch.csv_file, launch.json_file,
                     "; each of several sides to its own, run.SIDE.csv");
  add_record_options(app, launch.record);
  app.add_flag_callback(
      "--no-realtime", [&] { launch.is_realtime = false; },
      "ordinary scheduling, whatever the session says");
  app.add_flag("--insecure", launch.is_insecure,
               "tcp beyond loopback without keys: anybody on the network can look on and push");
  const auto take_together = [&](const std::vector<std::string>& nodes) {
    const std::set<std::string> given(nodes.begin(), nodes.end());
    launch.is_together = given == std::set<std::string>{"device", "mofc"} && nodes.size() == 2;
    if (launch.is_together) return;
    throw CLI::ValidationError("--together",
                               "only device and mofc can share a process; give device,mofc");
  };
  app.add_option_function<std::vector<std::string>>(
         "--together", take_together,
         "these nodes in one process, where the tick calls the clamp: fits 4 kHz")
      ->type_name("device,mofc")
      ->delimiter(',')
      ->allow_extra_args(false);
  CLI::Option* const nodes =
      app.add_option("--nodes", launch.nodes, "only these run here, the others on other machines")
          ->type_name("NODE,…")
          ->delimiter(',')
          ->allow_extra_args(false)
          ->check(CLI::IsMember(launch.nodes));
  app.add_flag_callback(
         "--no-viewer", [&] { launch.nodes.erase("viewer"); },
         "no status line: do not start viewer_node")
      ->excludes(nodes);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);  // who reads our output may go; the run is finished in order
  std::signal(SIGXFSZ, SIG_IGN);  // as in run_node
  CLI::App app("Runs and checks Palpate deployments.", "palpate");
  app.set_version_flag("--version", std::string("palpate ") + version());
  app.require_subcommand(1);
  LaunchCommand launch;
  CLI::App& launch_command = *app.add_subcommand(
      "launch", "run a session in real time: start its nodes, keep them running, sum up");
  add_launch_options(launch_command, launch);

  LoopbackArguments loopback;
  CLI::App& loopback_command = *app.add_subcommand(
      "loopback",
      "run a session in one process on virtual time: repeatable, faster than real time");
  loopback.add_to(loopback_command);

  InfoArguments info;
  CLI::App& info_command = *app.add_subcommand("info", "tell what a recording holds");
  info.add_to(info_command);

  ExportArguments exported;
  CLI::App& export_command = *app.add_subcommand("export", "write a recording as a table");
  exported.add_to(export_command);

  ReplayOptions replay;
  CLI::App& replay_command = *app.add_subcommand(
      "replay", "publish a recording as if it happened now: viewers look at it as at a live run");
  add_replay_options(replay_command, replay);

  ReportArguments report;
  CLI::App& report_command =
      *app.add_subcommand("report", "write the figures of a recording as one HTML file");
  report.add_to(report_command);

  IdentifyArguments identify;
  CLI::App& identify_command = *app.add_subcommand(
      "identify", "measure the friction of a session's device with its own motors, hand off");
  identify.add_to(identify_command);

  SessionArguments scene;
  CLI::App& scene_command = *app.add_subcommand("scene", "check a session without running it");
  scene_command.require_subcommand(1);
  CLI::App& check_command = *scene_command.add_subcommand(
      "check", "tell what is wrong with a session, or that nothing is (exit status 2, 0)");
  scene.add_to(check_command);

  DoctorArguments doctor;
  CLI::App& doctor_command = *app.add_subcommand(
      "doctor",
      "tell whether this machine is fit for a session, and what to do (exit status 0, 1)");
  doctor.add_to(doctor_command);

  KeygenArguments keygen;
  CLI::App& keygen_command = *app.add_subcommand(
      "keygen", "make the keys that links between machines need; overwrites none");
  keygen.add_to(keygen_command);

  OrganArguments organ;
  CLI::App& organ_command = *app.add_subcommand(
      "make-organ", "write an organ-like body as a point cloud or a mesh, to try sessions on");
  organ.add_to(organ_command);

  // of palpate itself: set once the commands, which would inherit it, are there
  app.footer(
      "Try:  palpate launch deploy/sessions/default.txtpb --seconds 10\n"
      "Each command has its own --help.");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitSetupError;
  }
  try {
    if (launch_command.parsed()) return launch.run();
    if (doctor_command.parsed()) return doctor.run();
    if (loopback_command.parsed()) loopback.run();
    if (info_command.parsed()) info.run();
    if (export_command.parsed()) exported.run();
    if (replay_command.parsed()) run_replay(replay);
    if (report_command.parsed()) report.run();
    if (identify_command.parsed()) identify.run();
    if (check_command.parsed()) check_scene(scene);
    if (keygen_command.parsed()) keygen.run();
    if (organ_command.parsed()) organ.run();
    return 0;
  } catch (const SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitSetupError;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "palpate: %s\n", error.what());
    return kExitFailure;
  }
}
