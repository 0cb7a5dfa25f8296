#include "deploy/palpate/recording_info.h"

#include <spdlog/fmt/fmt.h>

#include <stdexcept>
#include <type_traits>

#include "common/telemetry/summary.h"
#include "viewer_node/recording/recording.h"

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
  return content;
}

}  // namespace

nlohmann::ordered_json info_json(RecordingFile& recording) {
  const Content content = content_of(recording);
  const viewer::McapReader& mcap = recording.mcap();
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["file"] = mcap.path();
  json["bytes"] = mcap.file_bytes();
  json["is_whole"] = mcap.is_whole();
  json["damaged_chunks"] = mcap.damaged_chunks();
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
  json["records_lost"] = content.records_lost;
  json["messages"] = content.messages;
  json["ticks"] = content.ticks;
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
    text += fmt::format("  {:<24}{}\n", label, value);
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
  if (recording.refused() > 0) line("refused", fmt::format("{} messages", recording.refused()));
  if (mcap.damaged_chunks() > 0) line("damaged", fmt::format("{} chunks", mcap.damaged_chunks()));
  if (!mcap.is_whole())
    line("incomplete", "the file was not closed; up to its last second is missing");
  return text;
}

void export_csv(RecordingFile& recording, const std::string& csv_file, bool may_overwrite,
                const std::function<void(double)>& on_progress) {
  CsvWriter csv(csv_file, may_overwrite, OutputFile::Kind::kWhole);
  for_each_row(recording, [&](const TickRow& row) {
    if (on_progress) on_progress(recording.passed_ratio());
    csv.write(row);
  });
  csv.close();
  if (const auto error = csv.take_error()) throw std::runtime_error(*error);
}

}  // namespace palpate
