// SPDX-License-Identifier: Apache-2.0
// session_fuzz.cpp — reads any bytes as a session, as its overrides, as a recorded path and as a
// device profile. The result is a session or a SetupError, never a crash, a hang or another
// exception.
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/core/check.h"
#include "common/session/file/profile_file.h"
#include "common/session/file/recorded_path.h"
#include "common/session/session_file.h"

/// The input is the text of the session. Lines that begin with "#set " are overrides as well.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);

  constexpr std::string_view kMark = "#set ";
  std::vector<std::string> overrides;
  for (std::size_t at = text.find(kMark); at != std::string_view::npos;
       at = text.find(kMark, at + 1)) {
    const std::size_t begin = at + kMark.size();
    overrides.emplace_back(text.substr(begin, text.find('\n', begin) - begin));
  }
  try {
    const palpate::Session session = palpate::parse_session(text, "fuzz.txtpb", overrides);
    // some rules that every loaded session keeps
    PALPATE_REQUIRE(!session.name.empty());
    PALPATE_REQUIRE(session.side().device.rate_hz >= 10.0 &&
                    session.side().device.rate_hz <= 10000.0);
    PALPATE_REQUIRE(session.side().device.reply > palpate::Duration::zero());
    PALPATE_REQUIRE(session.side().device.lease > palpate::Duration::zero());
    PALPATE_REQUIRE(session.side().mofc.stale_after > palpate::Duration::zero());
  } catch (const palpate::SetupError&) {
    // expected of most inputs
  }

  palpate::Problems problems("fuzz.txtpb", {});
  const auto samples = palpate::parse_recorded_path(text, "fuzz.csv", {}, problems);
  PALPATE_REQUIRE(!samples.empty() || !problems.empty());

  palpate::Problems profile_problems("fuzz.txtpb", {});
  const auto profile = palpate::parse_profile(text, "fuzz.txtpb", {}, profile_problems);
  PALPATE_REQUIRE(!profile_problems.empty() ||
                  (profile.viscous_newton_s_per_m >= 0.0 && profile.coulomb_newton >= 0.0 &&
                   profile.position_resolution_m >= 0.0));
  return 0;
}
