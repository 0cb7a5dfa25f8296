// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/recordings/recording_info.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>

#include "common/telemetry/summary.h"
#include "deploy/palpate/screen/verdict.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/recording/recording_copy.h"
#include "viewer_node/recording/run_figures.h"

namespace palpate {
namespace {

/// Counts of one pass over the whole file.
struct Content {
  std::map<std::string, std::uint64_t> messages;  // by topic
  std::map<std::string, std::uint64_t> ticks;     // by node
  std::uint64_t records_lost = 0;                 // before the nodes could publish them
};

Content content_of(RecordingFile& recording) {
  const auto channels = viewer::recorded_channels();
  Content content;
  std::map<std::string, std::uint64_t> lost;  // by topic and side
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    const std::string& topic = channels[item->message.index()].topic;
    ++content.messages[topic];
    std::visit(
        [&](const auto& batch) {
          if constexpr (requires { batch.records; }) {
            content.ticks[topic.substr(1)] += batch.records.size();
            lost[with_side(batch.side, topic)] = batch.records_lost;
          }
        },
        item->message);
  }
  for (const auto& [node, count] : lost) content.records_lost += count;
  if (recording.ideal_messages() > 0) content.messages["/ideal"] = recording.ideal_messages();
  content.messages["/markers"] = recording.markers().size();
  if (content.messages["/markers"] == 0) content.messages.erase("/markers");
  return content;
}

double seconds_of(const RecordingFile& recording, const Marker& marker) {
  return (static_cast<double>(marker.at_ns) - static_cast<double>(recording.mcap().begin_ns())) *
         1e-9;
}

}  // namespace

nlohmann::ordered_json info_json(RecordingFile& recording) {
  const Content content = content_of(recording);
  const viewer::McapReader& mcap = recording.mcap();
  nlohmann::ordered_json json;
  json["schema_version"] = kSummarySchemaVersion;
  json["file"] = mcap.path();
  json["bytes"] = mcap.file_bytes();
  json["is_whole"] = mcap.is_whole();
  json["damaged_chunks"] = mcap.damaged_chunks();
  json["unreadable_bytes"] = mcap.unreadable_bytes();
  json["refused_messages"] = recording.refused();
  json["chunks"] = mcap.chunk_count();
  json["begin_ns"] = mcap.begin_ns();
  json["length_s"] = recording.length_s();
  for (const char* key : {"session_name", "session_file", "controller", "seed", "sides",
                          "recorded_by", "version", "protocol_major"}) {
    json[key] = recording.about(key);
  }
  json["nodes"] = mcap.metadata(viewer::kNodesMetadata);
  json["loss"] = mcap.metadata(viewer::kLossMetadata);
  json["copy"] = mcap.metadata(viewer::kCopyMetadata);
  json["records_lost"] = content.records_lost;
  json["messages"] = content.messages;
  json["ticks"] = content.ticks;
  for (const std::string& side : recording.sides()) {
    recording.choose_side(side);
    RecordedRun run;
    read_run(recording, run);
    nlohmann::ordered_json figures =
        figures_json(controller_of(recording, side), run.mirror, run.figures);
    figures["verdict"] = verdict_json(judge(facts_of(recording, run)));
    if (side.empty()) {
      json["figures"] = std::move(figures);
    } else {
      json["figures"]["sides"][side] = std::move(figures);
    }
  }
  json["markers"] = nlohmann::ordered_json::array();
  for (const Marker& marker : recording.markers()) {
    json["markers"].push_back(
        {{"t_s", seconds_of(recording, marker)}, {"text", marker.text}, {"origin", marker.origin}});
  }
  json["session"] = recording.about("session");
  return json;
}

std::string info_text(RecordingFile& recording) {
  const Content content = content_of(recording);
  const viewer::McapReader& mcap = recording.mcap();
  std::string text =
      fmt::format("{}: {}, {}, {:.3f} s, {:.2f} MB\n", mcap.path(), recording.about("session_name"),
                  recording.about("controller"), recording.length_s(),
                  static_cast<double>(mcap.file_bytes()) * 1e-6);
  const auto line = [&](const std::string& label, const std::string& value) {
    text += fmt::format("  {:<23} {}\n", label, value);
  };
  line("recorded by", recording.about("recorded_by") + ", version " + recording.about("version"));
  line("session file", recording.about("session_file"));
  line("seed", recording.about("seed"));
  for (const auto& [key, value] : mcap.metadata(viewer::kNodesMetadata)) line(key, value);
  for (const auto& [topic, count] : content.messages) {
    const auto ticks = content.ticks.find(topic.substr(1));
    line(topic, ticks != content.ticks.end()
                    ? fmt::format("{} ticks in {} messages", ticks->second, count)
                    : fmt::format("{} messages", count));
  }
  const auto loss = mcap.metadata(viewer::kLossMetadata);
  const auto dropped = loss.find("messages_dropped");
  if (dropped != loss.end() && dropped->second != "0") {
    line("dropped", dropped->second + " messages: the disk was too slow");
  }
  if (content.records_lost > 0) {
    line("lost",
         fmt::format("{} ticks, before the nodes could publish them", content.records_lost));
  }
  for (const Marker& marker : recording.markers()) {
    line("marker", fmt::format("{:.3f} s: {} ({})", seconds_of(recording, marker), marker.text,
                               marker.origin));
  }
  const auto copy = mcap.metadata(viewer::kCopyMetadata);
  if (copy.contains("command")) line(copy.at("command"), "of " + copy.at("sources"));
  const std::vector<std::string> sides = recording.sides();
  for (const std::string& side : sides) {
    recording.choose_side(side);
    RecordedRun run;
    read_run(recording, run);
    if (!side.empty()) text += "  " + side + ":\n";
    for (const auto& [label, value] :
         figure_lines(controller_of(recording, side), run.mirror, run.figures)) {
      line(label, value);
    }
    text += verdict_text(judge(facts_of(recording, run)));
  }
  if (const std::string damage = recording.damage(); !damage.empty()) {
    line("damaged", "missing: " + damage);
  }
  return text;
}

void export_csv(RecordingFile& recording, const std::string& csv_file, bool may_overwrite,
                const std::function<void(double)>& on_progress) {
  CsvWriter csv(csv_file, may_overwrite, OutputFile::Kind::kWhole);
  for_each_row(recording, [&](const TickRow& row) {
    if (on_progress) on_progress(recording.passed_ratio());
    csv.write(row);
    if (!csv.has_reader()) throw ReaderHasLeft();
  });
  csv.close();
  if (const auto error = csv.take_error()) throw std::runtime_error(*error);
}

}  // namespace palpate
