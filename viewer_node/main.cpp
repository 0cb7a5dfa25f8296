// SPDX-License-Identifier: Apache-2.0
// viewer_node: displays and records what the nodes of a session publish.
// All logic is in the library; this file only reads the command line.
#include <CLI/CLI.hpp>
#include "common/link/plot_sender.h"
#include "common/process/options.h"
#include "viewer_node/openigtlink/server.h"
#include "viewer_node/process.h"
#include "viewer_node/server/web_limits.h"

int main(int argc, char** argv) {
  palpate::viewer::ViewerOptions options;
  return palpate::run_node(
      argc, argv,
      {.name = "viewer",
       .description = "Displays and records a running session: a web page, the Foxglove "
                      "WebSocket, a status line, one CSV row per device tick, an MCAP file.",
       .add_options =
           [&](CLI::App& app) {
             palpate::add_csv_option(app, options.csv_file,
                                     "; with several sides, one file per side, run.SIDE.csv");
             palpate::add_record_option(app, options.record.file);
             palpate::add_overwrite_flag(app, options.record.may_overwrite);
             app.add_option("--plotjuggler", options.plotjuggler,
                            "publish every tick for PlotJuggler's ZMQ Subscriber, with the schema "
                            "proto/palpate/v1/plot.proto, on this machine only; with several "
                            "sides, the first")
                 ->type_name("[ENDPOINT]")
                 ->expected(0, 1)
                 ->default_str(palpate::kPlotEndpoint);
             app.add_option("--openigtlink", options.openigtlink,
                            "serve tool, forces and tissues to 3D Slicer by OpenIGTLink at this "
                            "port, on this machine only (0: any that is free)")
                 ->type_name("[PORT]")
                 ->expected(0, 1)
                 ->default_str(std::to_string(palpate::viewer::igtl::kPort));
             app.add_flag("--quiet", options.is_quiet, "no status line");
             palpate::viewer::WebOptions& web = options.web;
             app.add_option(
                    "--listen", web.listen,
                    "serve the page at this address, e.g. 127.0.0.1:8765; other addresses than "
                    "loopback need --token-file (default: 127.0.0.1, port of the session)")
                 ->type_name("ADDRESS:PORT");
             app.add_option("--listen-descriptor", web.descriptor)
                 ->check(CLI::NonNegativeNumber)
                 ->group("");  // of `palpate launch`: a socket that it has opened for the page
             app.add_flag("--no-web", web.is_off, "serve no page");
             app.add_option("--record-folder", web.record_folder,
                            "folder of recordings that a page begins (default: the current one on "
                            "loopback, none elsewhere)")
                 ->type_name("FOLDER");
             app.add_option("--token-file", web.token_file,
                            "require the token in this file from clients: http://…/?token=TOKEN")
                 ->type_name("FILE");
             app.add_option("--allow-origin", web.origins,
                            "allow pages of this origin to connect, e.g. https://app.example.org")
                 ->type_name("URL")
                 ->allow_extra_args(false);
             app.add_option(
                    "--allow-host", web.hosts,
                    "also accept this host name; localhost and numeric addresses always are")
                 ->type_name("NAME")
                 ->allow_extra_args(false);
             app.add_option("--proxy", web.proxies,
                            "numeric address of a reverse proxy: no limit on its connections")
                 ->type_name("ADDRESS")
                 ->allow_extra_args(false);
             app.add_option("--audience", web.audience,
                            "serve at most N clients that only watch, each as fast as it reads: "
                            "the newest state, positions in steps of 0.05 mm")
                 ->type_name("N")
                 ->check(CLI::Range(std::size_t{1}, palpate::viewer::kMaxAudience));
             app.add_option("--audience-rate", web.audience_rate_hz,
                            "updates of each client of the audience, at most (default: 10)")
                 ->type_name("HZ")
                 ->check(CLI::Range(0.1, 30.0));
             app.add_option("--publish", options.publish,
                            "be a relay: pass all telemetry on at this endpoint, e.g. "
                            "tcp://0.0.0.0:5570, to any number of viewers with --follow")
                 ->type_name("ENDPOINT");
             app.add_option(
                    "--follow", options.follow,
                    "take the telemetry from the relay at this endpoint instead of the nodes")
                 ->type_name("ENDPOINT");
           }},
      [&](palpate::NodeContext& context) {
        using palpate::KeyRole;
        const auto& security = context.session.security;
        const KeyRole own = options.follow.empty() ? KeyRole::kViewer : KeyRole::kAudience;
        palpate::ProcessLinks links(
            {.priority = 0, .cpu = -1},
            options.publish.empty()
                ? palpate::tcp_rules(security, {own}, {KeyRole::kPointer})
                : palpate::tcp_rules(security, {own, KeyRole::kRelay}, {KeyRole::kPointer}));
        palpate::viewer::run_process(context, links, options);
      });
}
