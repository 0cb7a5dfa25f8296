// SPDX-License-Identifier: Apache-2.0
// The recording as a file: what was written is read, whole or cut off.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/recording/mcap_format.h"
#include "viewer_node/recording/mcap_reader.h"
#include "viewer_node/recording/mcap_writer.h"
#include "viewer_node/recording/recording_copy.h"

namespace palpate::viewer {
namespace {

constexpr std::uint64_t kMillisecond_ns = 1'000'000;

const std::vector<mcap::Channel> kChannels = {{"/a", "test.A", "descriptor a"},
                                              {"/b", "test.B", "descriptor b"}};

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Message i at i ms, "message i", alternately on both channels.
void write_messages(McapWriter& writer, std::uint64_t begin, std::uint64_t end) {
  for (std::uint64_t i = begin; i < end; ++i) {
    writer.write(i % 2, i * kMillisecond_ns, "message " + std::to_string(i));
  }
}

std::vector<std::string> read_messages(McapReader& reader) {
  std::vector<std::string> messages;
  while (const auto message = reader.next()) messages.emplace_back(message->payload);
  return messages;
}

class Mcap : public testing::Test {
 protected:
  std::string write_file(std::uint64_t messages) {
    McapWriter writer(path, true, kChannels);
    writer.add_metadata("run", {{"session", "default"}, {"version", "1"}});
    write_messages(writer, 0, messages);
    writer.add_metadata("run", {{"version", "2"}});
    writer.close();
    EXPECT_EQ(writer.take_error(), std::nullopt);
    return bytes_of(path);
  }
  void put_file(const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

  test::TempFolder folder;
  std::string path = (folder.path() / "run.mcap").string();
};

TEST_F(Mcap, WhatWasWrittenIsReadInOrder) {
  write_file(3000);

  McapReader reader(path);
  EXPECT_TRUE(reader.is_whole());
  ASSERT_EQ(reader.topics().size(), 2u);
  EXPECT_EQ(reader.topics()[1].topic, "/b");
  EXPECT_EQ(reader.topics()[1].schema_name, "test.B");
  EXPECT_EQ(reader.topics()[1].messages, 1500u);
  EXPECT_EQ(reader.chunk_count(), 6u);  // 3 s in chunks of 0.5 s
  EXPECT_EQ(reader.begin_ns(), 0u);
  EXPECT_EQ(reader.end_ns(), 2999 * kMillisecond_ns);
  const mcap::Strings expected = {{"session", "default"}, {"version", "2"}};
  EXPECT_EQ(reader.metadata("run"), expected);

  const std::vector<std::string> messages = read_messages(reader);
  ASSERT_EQ(messages.size(), 3000u);
  for (std::size_t i = 0; i < 3000; ++i) EXPECT_EQ(messages[i], "message " + std::to_string(i));
}

TEST_F(Mcap, SeekFindsTheFirstMessageOfATime) {
  write_file(3000);
  McapReader reader(path);
  reader.seek(1234 * kMillisecond_ns - 1);
  const auto message = reader.next();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->payload, "message 1234");
  reader.seek(0);
  EXPECT_EQ(reader.next()->payload, "message 0");
}

TEST_F(Mcap, SeekLeavesOutTheChunksAfterAnEnd) {
  write_file(3000);
  McapReader reader(path);
  reader.seek(0, 1200 * kMillisecond_ns);
  // chunks of 0.5 s: the one of 1200 ms ends at 1499
  EXPECT_EQ(read_messages(reader).size(), 1500u);
}

/// A record of another writer.
std::string record_of(mcap::Opcode opcode, const std::string& content) {
  std::string bytes;
  mcap::Bytes(bytes).head(opcode, content.size());
  return bytes + content;
}
std::string footer_of(std::uint64_t summary_start) {
  std::string content;
  mcap::Bytes(content).number(summary_start).number(std::uint64_t{0}).number(std::uint32_t{0});
  return record_of(mcap::Opcode::kFooter, content) + std::string(mcap::kMagic);
}
std::string message_of(std::uint64_t time_ns, const std::string& payload) {
  std::string message;
  mcap::Bytes(message).number(std::uint16_t{5}).number(std::uint32_t{0}).number(time_ns);
  mcap::Bytes(message).number(time_ns);
  return record_of(mcap::Opcode::kMessage, message + payload);
}
std::string definitions() {
  std::string schema;
  mcap::Bytes(schema).number(std::uint16_t{1}).text("test.C").text("protobuf").text("descriptor");
  std::string channel;
  mcap::Bytes(channel)
      .number(std::uint16_t{5})
      .number(std::uint16_t{1})
      .text("/c")
      .text("protobuf");
  mcap::Bytes(channel).strings({});
  return record_of(mcap::Opcode::kSchema, schema) + record_of(mcap::Opcode::kChannel, channel);
}
std::string begin_of_file() {
  std::string header;
  mcap::Bytes(header).text("").text("other");
  return std::string(mcap::kMagic) + record_of(mcap::Opcode::kHeader, header);
}
/// A chunk of these records. @param crc  0: it has none
std::string chunk_of(std::uint64_t time_ns, const std::string& records, std::uint32_t crc = 0) {
  std::string chunk;
  mcap::Bytes(chunk).number(time_ns).number(time_ns);
  mcap::Bytes(chunk).number(std::uint64_t{records.size()}).number(crc).text("");
  mcap::Bytes(chunk).number(std::uint64_t{records.size()});
  return record_of(mcap::Opcode::kChunk, chunk + records);
}
/// A valid file whose schema and channel are in its only chunk, with one message.
std::string with_definitions_in_the_chunk() {
  const std::string records = definitions() + message_of(7, "payload");
  return begin_of_file() + chunk_of(7, records) +
         record_of(mcap::Opcode::kDataEnd, std::string(4, '\0'));
}

// The summary is optional, and so is the repetition of schemas and channels in it.
TEST_F(Mcap, AFileOfAnotherWriterWithoutSummaryIsWhole) {
  put_file(with_definitions_in_the_chunk() + footer_of(0));

  McapReader reader(path);
  EXPECT_TRUE(reader.is_whole());
  ASSERT_EQ(reader.topics().size(), 1u);
  EXPECT_EQ(reader.topics()[0].topic, "/c");
  EXPECT_EQ(reader.topics()[0].schema_name, "test.C");
  EXPECT_EQ(reader.topics()[0].schema, "descriptor");
  EXPECT_EQ(read_messages(reader), std::vector<std::string>{"payload"});
}

TEST_F(Mcap, ASummaryThatListsNoChunksIsNotTheWholeTruth) {
  const std::string data = with_definitions_in_the_chunk();
  std::string statistics;
  mcap::Bytes(statistics).number(std::uint64_t{1}).number(std::uint16_t{1});
  statistics += std::string(4 + 4 + 4 + 4 + 8 + 8 + 4, '\0');
  put_file(data + record_of(mcap::Opcode::kStatistics, statistics) + footer_of(data.size()));

  McapReader reader(path);
  EXPECT_TRUE(reader.is_whole());
  EXPECT_EQ(reader.topics().size(), 1u);
  EXPECT_EQ(read_messages(reader), std::vector<std::string>{"payload"});
}

TEST_F(Mcap, MessagesOutsideChunksAreReadWithAndWithoutAnEnd) {
  const std::string messages = definitions() + message_of(7, "first") + message_of(9, "second") +
                               record_of(mcap::Opcode::kMessageIndex, "between") +
                               message_of(8, "third");
  const std::string end = record_of(mcap::Opcode::kDataEnd, std::string(4, '\0')) + footer_of(0);
  const std::vector<std::string> all{"first", "second", "third"};
  for (const bool is_whole : {true, false}) {
    put_file(begin_of_file() + messages + (is_whole ? end : message_of(10, "cut").substr(0, 20)));

    McapReader reader(path);
    EXPECT_EQ(reader.is_whole(), is_whole);
    EXPECT_EQ(reader.chunk_count(), 0U);
    EXPECT_EQ(reader.begin_ns(), 7U);
    EXPECT_EQ(reader.end_ns(), 9U);
    EXPECT_EQ(read_messages(reader), all);
    reader.seek(9);
    EXPECT_EQ(read_messages(reader), std::vector<std::string>{"second"});
  }
}

// 500 bytes at any place: every message that they do not touch is read.
TEST_F(Mcap, ReadingGoesOnAfterDamageOutsideChunks) {
  constexpr std::size_t kDamaged = 500;
  std::string data = begin_of_file() + definitions();
  std::vector<std::pair<std::size_t, std::string>> begins;
  for (int i = 0; i < 60; ++i) {
    const std::string payload = "message " + std::to_string(i) + std::string(40, '.');
    begins.emplace_back(data.size(), payload);
    data += message_of(static_cast<std::uint64_t>(i), payload);
  }
  const std::size_t end = data.size();
  data += record_of(mcap::Opcode::kDataEnd, std::string(4, '\0')) + footer_of(0);
  std::mt19937 random(3);
  for (std::size_t at = begins[0].first; at + kDamaged <= end; at += 7) {
    for (const bool is_zero : {true, false}) {
      std::string bytes = data;
      for (std::size_t i = at; i < at + kDamaged; ++i) {
        bytes[i] = is_zero ? '\0' : static_cast<char>(random());
      }
      put_file(bytes);
      McapReader reader(path);
      const std::vector<std::string> messages = read_messages(reader);
      const std::set<std::string> found(messages.begin(), messages.end());
      for (std::size_t i = 0; i < begins.size(); ++i) {
        const auto& [begin, payload] = begins[i];
        const std::size_t next = i + 1 < begins.size() ? begins[i + 1].first : end;
        if (next <= at || begin >= at + kDamaged) {
          ASSERT_TRUE(found.contains(payload))
              << i << " of damage at " << at << (is_zero ? " with zeros, " : ", ") << found.size()
              << " read, " << reader.unreadable_bytes() << " bytes left out";
        }
      }
      ASSERT_GT(reader.unreadable_bytes(), kDamaged / 2) << at;
      ASSERT_LT(reader.unreadable_bytes(), kDamaged + 200) << at;
      ASSERT_TRUE(reader.is_whole()) << at;
    }
  }
}

TEST_F(Mcap, ReadingGoesOnAfterADamagedHeadOfAChunk) {
  const std::string first = chunk_of(1, message_of(1, "first"));
  const std::string last = chunk_of(3, message_of(3, "third"));
  for (const std::size_t at : {0U, 1U, 6U, 8U, 26U, 41U}) {  // opcode, length, sizes
    std::string middle = chunk_of(2, message_of(2, "second"));
    middle[at] = static_cast<char>(middle[at] ^ 0x21);
    std::string file = begin_of_file() + definitions();
    file.append(first).append(middle).append(last);
    file += record_of(mcap::Opcode::kDataEnd, std::string(4, '\0')) + footer_of(0);
    put_file(file);
    McapReader reader(path);
    EXPECT_EQ(read_messages(reader), (std::vector<std::string>{"first", "second", "third"})) << at;
    EXPECT_GT(reader.unreadable_bytes(), 0U) << at;
  }
}

TEST_F(Mcap, TheEndThatACrashHasCutIsCounted) {
  const std::string whole = begin_of_file() + definitions() + chunk_of(1, message_of(1, "first"));
  put_file(whole + std::string(mcap::kMagic.size(), 'x'));
  McapReader reader(path);
  EXPECT_FALSE(reader.is_whole());
  EXPECT_EQ(read_messages(reader), std::vector<std::string>{"first"});
  EXPECT_EQ(reader.unreadable_bytes(), mcap::kMagic.size());
}

// The summary repeats schemas and channels; that it lists no chunks must not lose them.
TEST_F(Mcap, DefinitionsOfADamagedFirstChunkAreTakenFromTheSummary) {
  const std::string records = definitions() + message_of(7, "first");
  std::string damaged = chunk_of(7, records, mcap::crc_of(records));
  damaged.back() = '?';
  const std::string data = begin_of_file() + damaged + chunk_of(8, message_of(8, "second")) +
                           record_of(mcap::Opcode::kDataEnd, std::string(4, '\0'));
  put_file(data + definitions() + footer_of(data.size()));
  std::vector<std::unique_ptr<McapReader>> sources;
  sources.push_back(std::make_unique<McapReader>(path));
  const std::string copy = (folder.path() / "copy.mcap").string();

  const CopyResult result =
      copy_recordings(sources, {.command = "recover", .file = copy, .is_recovery = true});

  EXPECT_EQ(result.loss(), "1 damaged chunks");
  McapReader reader(copy);
  ASSERT_EQ(reader.topics().size(), 1u);
  EXPECT_EQ(reader.topics()[0].schema, "descriptor");
  EXPECT_EQ(read_messages(reader), std::vector<std::string>{"second"});
}

TEST_F(Mcap, ASummaryOverSixtyFourMebibytesIsNotNeeded) {
  const std::string data = with_definitions_in_the_chunk();
  const std::string filling =
      record_of(mcap::Opcode::kSummaryOffset, std::string((std::size_t{64} << 20) + 1, 'x'));
  put_file(data + filling + footer_of(data.size()));

  McapReader reader(path);
  EXPECT_TRUE(reader.is_whole());
  EXPECT_EQ(read_messages(reader), std::vector<std::string>{"payload"});
}

// As ticks that are older than the message that brought them, and after the wall clock was set
// back.
TEST_F(Mcap, APartHasTheMessagesOfItsTimeThatFollowALaterOne) {
  {
    McapWriter writer(path, true, kChannels);
    for (const std::uint64_t at_ms : {0U, 10U, 30U, 15U, 40U}) {
      writer.write(0, at_ms * kMillisecond_ns, std::to_string(at_ms));
    }
    writer.close();
  }
  std::vector<std::unique_ptr<McapReader>> sources;
  sources.push_back(std::make_unique<McapReader>(path));
  const std::string part = (folder.path() / "part.mcap").string();

  copy_recordings(sources, {.command = "cut", .file = part, .to_s = 0.020});

  McapReader reader(part);
  EXPECT_EQ(read_messages(reader), (std::vector<std::string>{"0", "10", "15"}));
}

TEST_F(Mcap, TheSameCallsGiveTheSameFile) {
  const std::string first = write_file(1200);
  EXPECT_EQ(write_file(1200), first);
  EXPECT_NE(write_file(1201), first);
}

// Chunks of 0.5 s end on the disk at once: what is lost of an unfinished file is the last one.
TEST_F(Mcap, ACrashLosesLessThanASecond) {
  McapWriter writer(path, false, kChannels);
  writer.add_metadata("run", {{"session", "default"}});
  write_messages(writer, 0, 2400);

  McapReader reader(path);
  EXPECT_FALSE(reader.is_whole());
  EXPECT_EQ(reader.metadata("run").at("session"), "default");
  EXPECT_EQ(reader.topics().size(), 2u);
  EXPECT_EQ(read_messages(reader).size(), 2000u);

  writer.flush();
  McapReader after_flush(path);
  EXPECT_EQ(read_messages(after_flush).size(), 2400u);
}

TEST_F(Mcap, EveryTruncationIsReadAsFarAsItGoes) {
  const std::string whole = write_file(1100);
  std::size_t before = 0;
  for (std::size_t length = 8; length <= whole.size(); length += 397) {
    put_file(whole.substr(0, length));
    McapReader reader(path);
    const std::vector<std::string> messages = read_messages(reader);
    ASSERT_GE(messages.size(), before) << length;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      ASSERT_EQ(messages[i], "message " + std::to_string(i));
    }
    before = messages.size();
  }
  EXPECT_EQ(before, 1100u);
}

// A flipped byte may cost messages, but never makes one that was not written.
TEST_F(Mcap, ADamagedByteIsNoticed) {
  const std::string whole = write_file(20);
  std::size_t damaged = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x41);
    put_file(bytes);
    try {
      McapReader reader(path);
      for (const std::string& message : read_messages(reader)) {
        ASSERT_TRUE(message.starts_with("message ")) << at;
      }
      damaged += reader.damaged_chunks();
    } catch (const SetupError&) {
    }
  }
  EXPECT_GT(damaged, 20u * 31u);  // at least every byte of every message
}

TEST_F(Mcap, AnExistingFileIsNotOverwrittenUnasked) {
  write_file(10);
  EXPECT_THROW(McapWriter(path, false, kChannels), SetupError);
  McapReader reader(path);
  EXPECT_EQ(read_messages(reader).size(), 10u);
}

TEST_F(Mcap, AFullDiskIsToldOnceAndEndsTheRecording) {
  McapWriter writer("/dev/full", true, kChannels);
  write_messages(writer, 0, 2000);
  writer.close();
  const auto error = writer.take_error();
  ASSERT_TRUE(error);
  EXPECT_NE(error->find("recording /dev/full: No space left on device"), std::string::npos);
  EXPECT_EQ(writer.take_error(), std::nullopt);
}

TEST_F(Mcap, OtherFilesAreRefused) {
  EXPECT_THROW(McapReader(folder.path() / "absent.mcap"), SetupError);
  EXPECT_THROW(McapReader(folder.path()), SetupError);
  EXPECT_THROW(McapReader(folder.write("a.csv", "t_s,x_m\n0,1\n")), SetupError);
  EXPECT_THROW(McapReader(folder.write("empty.mcap", "")), SetupError);
}

}  // namespace
}  // namespace palpate::viewer
