// SPDX-License-Identifier: Apache-2.0
// mcap_fuzz.cpp — any bytes as a recording: what can be read of it, or a SetupError; never a crash,
// a hang or another exception.
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/core/check.h"
#include "deploy/palpate/recordings/recording_info.h"
#include "viewer_node/recording/recording_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int file = memfd_create("fuzz.mcap", MFD_CLOEXEC);
  PALPATE_REQUIRE(file >= 0 && write(file, data, size) == static_cast<ssize_t>(size));
  const std::string path = "/proc/self/fd/" + std::to_string(file);
  try {
    palpate::RecordingFile recording(path);
    PALPATE_REQUIRE(recording.mcap().file_bytes() == size);
    static_cast<void>(palpate::info_json(recording));
    static_cast<void>(recording.length_s());
    std::size_t messages = 0;
    recording.seek(0);
    while (recording.next() != nullptr) ++messages;
    PALPATE_REQUIRE(messages <= size);
    palpate::for_each_row(recording, [](const palpate::TickRow&) {});
    static_cast<void>(palpate::hand_path_of(recording, {}));
  } catch (const palpate::SetupError&) {
    // what most inputs deserve
  }
  close(file);
  return 0;
}
