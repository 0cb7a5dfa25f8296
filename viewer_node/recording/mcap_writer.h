// SPDX-License-Identifier: Apache-2.0
// mcap_writer.h — writes a run to an MCAP file: indexed chunks with checksums, in the order
// written. Blocks on the disk; do not use it on a tick thread.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/user/output_file.h"
#include "viewer_node/recording/mcap_format.h"

namespace palpate::viewer {

/// A chunk is written at this size or time span; a crash loses no more.
inline constexpr std::size_t kChunkBytes = std::size_t{1} << 20;
inline constexpr std::uint64_t kChunkSpan_ns = 500'000'000;

/// The same calls write the same file, bit for bit. Chunks are not compressed.
class McapWriter {
 public:
  /// Creates `path`. Throws SetupError if it cannot, or if it exists and `may_overwrite` is false.
  /// @param channels  topic i is channel i of write()
  /// @param kind  kWhole: the file appears at close(), for copies
  McapWriter(std::string path, bool may_overwrite, const std::vector<mcap::Channel>& channels,
             OutputFile::Kind kind = OutputFile::Kind::kStream);
  /// Closes a stream; call close() first to detect errors.
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  void add_metadata(const std::string& name, const mcap::Strings& strings);
  /// Appends to the current chunk. @param channel  index in `channels`
  void write(std::size_t channel, std::uint64_t log_time_ns, std::string_view payload);
  /// Hands everything so far to the operating system, so that the end of this process loses
  /// nothing.
  void flush();
  /// Flushes and adds the summary; nothing is written after it.
  void close();

  /// The file's error, reported once. Nothing is written after an error; earlier data stay
  /// readable.
  [[nodiscard]] std::optional<std::string> take_error();

 private:
  struct MetadataPlace {
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    std::string name;
  };
  struct Topic {
    std::uint16_t id = 0;
    std::uint32_t sequence = 0;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> index;  // of the current chunk
  };

  void end_chunk();
  void put(const std::string& bytes);
  [[nodiscard]] std::string summary() const;

  OutputFile file_;
  OutputFile::Kind kind_;
  std::uint64_t offset_ = 0;  // of the end of the file
  std::uint32_t data_crc_ = 0;
  std::string definitions_;                                 // Schema and Channel records
  std::pair<std::size_t, std::size_t> definition_bytes_{};  // of the schemas, of the channels
  std::vector<Topic> topics_;
  std::string chunk_;
  std::uint64_t chunk_begin_ns_ = 0;
  std::uint64_t chunk_end_ns_ = 0;
  std::uint64_t begin_ns_ = 0;
  std::uint64_t end_ns_ = 0;
  std::string chunk_indexes_;  // ChunkIndex records: some 150 bytes a chunk until close()
  std::uint32_t chunks_ = 0;
  std::vector<MetadataPlace> metadata_;
  bool has_given_error_ = false;
};

}  // namespace palpate::viewer
