// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/recording_copy.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"
#include "viewer_node/recording/mcap_writer.h"
#include "viewer_node/recording/recording.h"

namespace palpate::viewer {
namespace {

constexpr std::uint64_t kNextRun = std::uint64_t{1} << 32U;
constexpr std::string_view kSceneTopic = "/scene_state";
constexpr std::string_view kMeshTopic = "/mesh";
constexpr std::string_view kMarkerTopic = "/markers";

bool is_wanted(const std::string& topic, const std::vector<std::string>& wanted) {
  return wanted.empty() || std::any_of(wanted.begin(), wanted.end(), [&](const std::string& name) {
           return topic == name || topic.ends_with(name[0] == '/' ? name : "/" + name);
         });
}

/// One source with its place in the copy.
struct Source {
  McapReader& reader;
  std::map<std::uint16_t, std::size_t> channel_of{};  // in the copy, by id in the source
  std::uint64_t shift_ns = 0;                         // added to its times
  std::uint64_t shift_id = 0;                         // added to the session ids of its nodes
  std::optional<McapReader::Message> head{};          // next message

  [[nodiscard]] std::uint64_t time_ns() const { return head->log_time_ns + shift_ns; }
  void advance() {
    do {
      head = reader.next();
    } while (head && !channel_of.contains(head->channel_id));
  }
};

/// The message as one of another run of its nodes; as it is if it cannot be read.
template <class T>
std::string of_other_run(std::string_view payload, std::uint64_t shift_id) {
  Codec<T> codec;
  T message;
  std::string frame(1, static_cast<char>(kKindOf<T>));
  frame += payload;
  if (codec.decode(std::as_bytes(std::span(frame)), message) != DecodeError::kNone) {
    return std::string(payload);
  }
  message.header.session_id += shift_id;
  if constexpr (std::is_same_v<T, MofcBatch>) {
    for (MofcTick& tick : message.records) tick.device_session_id += shift_id;
  }
  return payload_of(codec, message);
}
std::string of_other_run(const std::string& topic, std::string_view payload,
                         std::uint64_t shift_id) {
  if (topic == "/device") return of_other_run<DeviceBatch>(payload, shift_id);
  if (topic == "/mofc") return of_other_run<MofcBatch>(payload, shift_id);
  if (topic == "/physics") return of_other_run<PhysicsBatch>(payload, shift_id);
  if (topic == kSceneTopic) return of_other_run<SceneState>(payload, shift_id);
  if (topic == kMeshTopic) return of_other_run<MeshFrame>(payload, shift_id);
  return std::string(payload);
}

template <class T>
bool is_frame_of(std::string_view payload) {
  T message;
  std::string frame(1, static_cast<char>(kKindOf<T>));
  frame += payload;
  return Codec<T>().decode(std::as_bytes(std::span(frame)), message) == DecodeError::kNone;
}
/// Whether the message is one of its topic; true for topics of others.
bool is_readable(const mcap::Channel& channel, std::string_view payload) {
  static const std::vector<mcap::Channel> ours = recorded_channels();
  static const mcap::Channel ideal = ideal_channel();
  const auto is_same = [&](const mcap::Channel& own) {
    return own.topic == channel.topic && own.schema_name == channel.schema_name;
  };
  if (is_same(ideal)) return decode_ideal(payload).has_value();
  if (std::none_of(ours.begin(), ours.end(), is_same)) return true;
  if (channel.topic == "/device") return is_frame_of<DeviceBatch>(payload);
  if (channel.topic == "/mofc") return is_frame_of<MofcBatch>(payload);
  if (channel.topic == "/physics") return is_frame_of<PhysicsBatch>(payload);
  if (channel.topic == kSceneTopic) return is_frame_of<SceneState>(payload);
  if (channel.topic == kMeshTopic) return is_frame_of<MeshFrame>(payload);
  return channel.topic != kMarkerTopic || decode_marker(payload).has_value();
}

class Copy {
 public:
  Copy(const std::vector<std::unique_ptr<McapReader>>& sources, const CopyOptions& options)
      : options_(options) {
    for (const auto& source : sources) sources_.push_back({*source});
    refuse_other_sessions();
    place_in_time();
    choose_channels();
    begin_ns_ = sources_.front().reader.begin_ns();
    for (const Source& source : sources_) {
      begin_ns_ = std::min(begin_ns_, source.reader.begin_ns() + source.shift_ns);
      end_ns_ = std::max(end_ns_, source.reader.end_ns() + source.shift_ns);
    }
    const double length_s = static_cast<double>(end_ns_ - begin_ns_) * 1e-9;
    if (options.from_s >= length_s && options.from_s > 0.0) {
      throw SetupError(fmt::format("--from {:g}: the recording is {:.3f} s long; give less",
                                   options.from_s, length_s));
    }
    from_ns_ = begin_ns_ + static_cast<std::uint64_t>(std::llround(options.from_s * 1e9));
    to_ns_ = options.to_s < length_s
                 ? begin_ns_ + static_cast<std::uint64_t>(std::llround(options.to_s * 1e9))
                 : end_ns_;
  }

  CopyResult run(const std::function<void(double)>& on_progress) {
    McapWriter writer(options_.file, options_.may_overwrite, channels_, OutputFile::Kind::kWhole);
    for (Source& source : sources_) {
      source.reader.seek(0, to_ns_ - source.shift_ns);
      source.advance();
    }
    while (Source* const source = earliest()) {
      const std::uint64_t at_ns = source->time_ns();
      if (at_ns > to_ns_) {  // an earlier one may follow: ticks are older than their message
        source->advance();
        continue;
      }
      if (on_progress && end_ns_ > begin_ns_) {
        on_progress(static_cast<double>(at_ns - begin_ns_) /
                    static_cast<double>(end_ns_ - begin_ns_));
      }
      take(*source, writer);
      source->advance();
    }
    write_state_of_begin(writer);  // if the copy contains nothing else
    write_metadata(writer);
    writer.close();
    if (const auto error = writer.take_error()) throw std::runtime_error(*error);
    return result_;
  }

 private:
  void refuse_other_sessions() const {
    const auto about = [](const Source& source, const char* key) {
      const mcap::Strings run = source.reader.metadata(kRunMetadata);
      const auto it = run.find(key);
      return it != run.end() ? it->second : std::string();
    };
    const Source& first = sources_.front();
    for (const Source& source : sources_) {
      if (about(source, "session") == about(first, "session")) continue;
      throw SetupError(fmt::format(
          "recordings {} and {}: of different sessions ({} and {}); merge those of one session",
          first.reader.path(), source.reader.path(), about(first, "session_name"),
          about(source, "session_name")));
    }
  }

  /// Process starts of each device node in a recording, with the sequences of the first and the
  /// last tick.
  using Starts = std::map<std::uint64_t, std::pair<std::uint64_t, std::uint64_t>>;
  using Runs = std::map<std::string, Starts>;

  void place_in_time() {
    std::vector<Runs> runs;
    for (std::size_t i = 0; i < sources_.size() && sources_.size() > 1; ++i) {
      Source& source = sources_[i];
      runs.push_back(runs_of(source.reader));
      if (i > 0 && options_.is_sequence) {
        const Source& before = sources_[i - 1];
        // modular arithmetic: the shift may be negative
        source.shift_ns = before.reader.end_ns() + before.shift_ns + 1 - source.reader.begin_ns();
        tell_runs_apart(runs);
        continue;
      }
      for (std::size_t k = 0; k < i; ++k) {
        refuse_two_runs_at_once(sources_[k].reader, runs[k], source.reader, runs[i]);
      }
    }
    note_seams(runs);
  }

  /// Where a source of another run begins, and where one did in a source. @param runs  of sources
  void note_seams(const std::vector<Runs>& runs) {
    for (const Source& source : sources_) {
      for (const std::uint64_t seam_ns : seams_of(source.reader)) {
        seams_ns_.insert(seam_ns + source.shift_ns);
      }
    }
    std::vector<std::size_t> order(runs.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto begin_ns = [&](std::size_t i) {
      return sources_[i].reader.begin_ns() + sources_[i].shift_ns;
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return begin_ns(a) < begin_ns(b); });
    for (std::size_t i = 1; i < order.size(); ++i) {
      const bool is_known =
          std::any_of(order.begin(), order.begin() + static_cast<int>(i),
                      [&](std::size_t k) { return is_same_run(runs, k, order[i]); });
      if (!is_known) seams_ns_.insert(begin_ns(order[i]));
    }
  }
  /// Whether a device_node of both is the same process.
  [[nodiscard]] bool is_same_run(const std::vector<Runs>& runs, std::size_t a,
                                 std::size_t b) const {
    if (runs[a].empty() || runs[b].empty()) return true;  // not known
    return std::any_of(runs[b].begin(), runs[b].end(), [&](const auto& node) {
      const auto same = runs[a].find(node.first);
      return same != runs[a].end() &&
             std::any_of(node.second.begin(), node.second.end(), [&](const auto& start) {
               return same->second.contains(start.first + sources_[b].shift_id -
                                            sources_[a].shift_id);
             });
    });
  }

  /// In lockstep the nodes of every run have the same ids: a run that does not continue the ones
  /// before it becomes a restart of its nodes. @param runs  of the sources so far
  void tell_runs_apart(const std::vector<Runs>& runs) {
    Source& newest = sources_[runs.size() - 1];
    for (std::size_t k = 0; k + 1 < runs.size();) {
      if (does_continue(runs[k], runs.back(), newest.shift_id - sources_[k].shift_id)) {
        ++k;
      } else {
        newest.shift_id += kNextRun;
        k = 0;
      }
    }
  }
  /// Whether every process start that is in both goes on in `after`.
  static bool does_continue(const Runs& before, const Runs& after, std::uint64_t shift_id) {
    for (const auto& [node, starts] : after) {
      const auto same = before.find(node);
      if (same == before.end()) continue;
      for (const auto& [id, ticks] : starts) {
        const auto earlier = same->second.find(id + shift_id);
        if (earlier != same->second.end() && earlier->second.second >= ticks.first) return false;
      }
    }
    return true;
  }

  /// Two runs of a session at the same time: one of them has another clock.
  static void refuse_two_runs_at_once(const McapReader& a, const Runs& a_runs, const McapReader& b,
                                      const Runs& b_runs) {
    if (a.begin_ns() > b.end_ns() || b.begin_ns() > a.end_ns()) return;
    for (const auto& [node, starts] : b_runs) {
      const auto same = a_runs.find(node);
      if (same == a_runs.end()) continue;
      const bool is_one_run = std::any_of(starts.begin(), starts.end(), [&](const auto& start) {
        return same->second.contains(start.first);
      });
      if (is_one_run) continue;
      throw SetupError(fmt::format(
          "recordings {} and {}: two runs of {} at the same time; --append puts one after the "
          "other",
          a.path(), b.path(), node));
    }
  }

  static Runs runs_of(McapReader& reader) {
    std::map<std::uint16_t, std::string> node_of;
    for (const McapReader::Topic& topic : reader.topics()) node_of[topic.id] = topic.topic;
    Runs runs;
    Codec<DeviceBatch> codec;
    DeviceBatch batch;
    reader.seek(0);
    while (const auto message = reader.next()) {
      if (node_of[message->channel_id] != "/device") continue;
      std::string frame(1, static_cast<char>(kKindOf<DeviceBatch>));
      frame += message->payload;
      if (codec.decode(std::as_bytes(std::span(frame)), batch) != DecodeError::kNone) continue;
      if (batch.records.empty()) continue;
      const auto [start, is_new] = runs[with_side(batch.side, "device_node")].try_emplace(
          batch.header.session_id, batch.records.front().sequence, 0);
      start->second.second = batch.records.back().sequence;
    }
    reader.seek(0);
    return runs;
  }

  void choose_channels() {
    for (Source& source : sources_) {
      for (const McapReader::Topic& topic : source.reader.topics()) {
        if (!is_wanted(topic.topic, options_.topics)) continue;
        const auto same =
            std::find_if(channels_.begin(), channels_.end(), [&](const mcap::Channel& channel) {
              return channel.topic == topic.topic && channel.schema_name == topic.schema_name;
            });
        source.channel_of[topic.id] = static_cast<std::size_t>(same - channels_.begin());
        if (same == channels_.end()) {
          channels_.push_back({topic.topic, topic.schema_name, topic.schema});
        }
      }
    }
    if (!channels_.empty()) return;
    if (options_.topics.empty()) {
      throw SetupError("recording " + sources_.front().reader.path() +
                       ": has no topic that can be read, so there is nothing to copy");
    }
    std::string names;
    for (const McapReader::Topic& topic : sources_.front().reader.topics()) {
      names += (names.empty() ? "" : ", ") + topic.topic;
    }
    throw SetupError("--topics: recording " + sources_.front().reader.path() +
                     " has none of them; it has " + names);
  }

  Source* earliest() {
    Source* first = nullptr;
    for (Source& source : sources_) {
      if (source.head && (first == nullptr || source.time_ns() < first->time_ns())) {
        first = &source;
      }
    }
    return first;
  }

  void take(const Source& source, McapWriter& writer) {
    const std::size_t channel = source.channel_of.at(source.head->channel_id);
    const std::string_view payload = source.head->payload;
    const std::uint64_t at_ns = source.time_ns();
    if (options_.is_recovery && !is_readable(channels_[channel], payload)) {
      ++result_.unreadable_messages;
      return;
    }
    if (at_ns < from_ns_) {
      keep_state(channel, payload);
      return;
    }
    write_state_of_begin(writer);
    if (sources_.size() > 1 && !options_.is_sequence &&
        !written_.insert({channel, std::hash<std::string_view>()(payload)}).second) {
      ++result_.duplicates;
      return;
    }
    ++result_.messages;
    if (source.shift_ns != 0 && channels_[channel].topic == kMarkerTopic) {
      auto marker = decode_marker(payload);
      if (!marker) return;
      marker->at_ns += source.shift_ns;
      writer.write(channel, at_ns, encode_marker(*marker));
    } else if (source.shift_id != 0) {
      writer.write(channel, at_ns,
                   of_other_run(channels_[channel].topic, payload, source.shift_id));
    } else {
      writer.write(channel, at_ns, payload);
    }
  }

  /// The scene, and the last frame of each tissue, of the time before the copy begins.
  void keep_state(std::size_t channel, std::string_view payload) {
    if (channels_[channel].topic == kSceneTopic) {
      scene_ = {channel, std::string(payload)};
      frames_.clear();
    } else if (channels_[channel].topic == kMeshTopic) {
      std::string frame(1, static_cast<char>(kKindOf<MeshFrame>));
      frame += payload;
      MeshFrame mesh;
      if (meshes_.decode(std::as_bytes(std::span(frame)), mesh) == DecodeError::kNone) {
        frames_[mesh.tissue] = {channel, std::string(payload)};
      }
    }
  }
  void write_state_of_begin(McapWriter& writer) {
    const auto write = [&](const auto& kept) {
      ++result_.messages;
      writer.write(kept.first, from_ns_, kept.second);
    };
    if (scene_) write(*scene_);
    for (const auto& [tissue, kept] : frames_) write(kept);
    scene_.reset();
    frames_.clear();
  }

  void write_metadata(McapWriter& writer) {
    std::string files;
    std::uint64_t dropped = 0;
    for (const Source& source : sources_) {
      files += (files.empty() ? "" : ", ") + source.reader.path();
      result_.damaged_chunks += source.reader.damaged_chunks();
      result_.unreadable_bytes += source.reader.unreadable_bytes();
      const mcap::Strings loss = source.reader.metadata(kLossMetadata);
      const auto it = loss.find("messages_dropped");
      if (it != loss.end()) dropped += std::strtoull(it->second.c_str(), nullptr, 10);
    }
    writer.add_metadata(kRunMetadata, sources_.front().reader.metadata(kRunMetadata));
    for (const Source& source : sources_) {
      writer.add_metadata(kNodesMetadata, source.reader.metadata(kNodesMetadata));
    }
    writer.add_metadata(kLossMetadata, {{"messages_dropped", std::to_string(dropped)}});
    std::vector<std::uint64_t> seams_ns;  // another run was before
    std::copy_if(seams_ns_.begin(), seams_ns_.end(), std::back_inserter(seams_ns),
                 [&](std::uint64_t at_ns) { return at_ns > from_ns_ && at_ns <= to_ns_; });
    const bool is_part =
        to_ns_ < end_ns_ || std::any_of(sources_.begin(), sources_.end(), [](const Source& source) {
          return breaks_off(source.reader);
        });
    writer.add_metadata(
        kCopyMetadata,
        {{"command", options_.command},
         {"breaks_off", is_part ? "1" : "0"},
         {"sources", files},
         {"seams", fmt::format("{}", fmt::join(seams_ns, ","))},
         {"topics", fmt::format("{}", fmt::join(options_.topics, ","))},
         {"from_s", fmt::format("{:.9g}", static_cast<double>(from_ns_ - begin_ns_) * 1e-9)},
         {"to_s", fmt::format("{:.9g}", static_cast<double>(to_ns_ - begin_ns_) * 1e-9)},
         {"damaged_chunks", std::to_string(result_.damaged_chunks)},
         {"unreadable_messages", std::to_string(result_.unreadable_messages)},
         {"unreadable_bytes", std::to_string(result_.unreadable_bytes)}});
  }

  const CopyOptions& options_;
  std::vector<Source> sources_;
  std::vector<mcap::Channel> channels_;  // of the copy
  std::uint64_t begin_ns_ = 0;
  std::uint64_t end_ns_ = 0;
  std::uint64_t from_ns_ = 0;
  std::uint64_t to_ns_ = 0;
  std::optional<std::pair<std::size_t, std::string>> scene_;             // channel, payload
  std::map<std::uint32_t, std::pair<std::size_t, std::string>> frames_;  // by tissue
  Codec<MeshFrame> meshes_;
  std::set<std::pair<std::size_t, std::size_t>> written_;  // channel, hash of the payload
  std::set<std::uint64_t> seams_ns_;                       // in the copy: another run begins
  CopyResult result_;
};

}  // namespace

std::vector<std::uint64_t> seams_of(const McapReader& recording) {
  const mcap::Strings copy = recording.metadata(kCopyMetadata);
  const auto it = copy.find("seams");
  std::vector<std::uint64_t> seams_ns;
  std::istringstream list(it != copy.end() ? it->second : "");
  for (std::string one; std::getline(list, one, ',');) {
    seams_ns.push_back(std::strtoull(one.c_str(), nullptr, 10));
  }
  return seams_ns;
}

bool breaks_off(const McapReader& recording) {
  const mcap::Strings copy = recording.metadata(kCopyMetadata);
  const auto it = copy.find("breaks_off");
  return !recording.is_whole() || (it != copy.end() && it->second == "1");
}

std::string CopyResult::loss() const {
  std::string text;
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
  };
  add(damaged_chunks, "damaged chunks");
  add(unreadable_messages, "unreadable messages");
  add(unreadable_bytes, "unreadable bytes");
  return text;
}

CopyResult copy_recordings(const std::vector<std::unique_ptr<McapReader>>& sources,
                           const CopyOptions& options,
                           const std::function<void(double)>& on_progress) {
  return Copy(sources, options).run(on_progress);
}

}  // namespace palpate::viewer
