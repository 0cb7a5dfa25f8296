// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes as list of allowed keys, key pair and request of libzmq. An accepted list has the
// keys of both servers; no arbitrary request is admitted.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/check.h"
#include "common/link/security/keys.h"
#include "common/link/security/zap_handler.h"

namespace {

template <class Parse>
void parse(const Parse& parse) {
  try {
    parse();
  } catch (const palpate::SetupError& error) {
    PALPATE_REQUIRE(std::string_view(error.what()).starts_with("fuzz: "));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  parse([&] {
    const auto allowed = palpate::parse_allowed_keys(text, "fuzz");
    for (const auto role : {palpate::KeyRole::kDevice, palpate::KeyRole::kPhysics}) {
      PALPATE_REQUIRE(allowed.role_of(allowed.server_key(role)) == role);
    }
  });
  parse([&] {
    const auto pair = palpate::parse_key_pair(text, "fuzz");
    PALPATE_REQUIRE(pair.public_key.size() == 40 && pair.secret_key.size() == 40);
  });

  // frames separated by line feeds, judged with a list of keys that are not in the corpus
  static const auto kAllowed =
      palpate::parse_allowed_keys("device " + palpate::new_key_pair().public_key + "\nphysics " +
                                      palpate::new_key_pair().public_key,
                                  "fuzz");
  std::vector<std::string> frames{""};
  for (const char c : text) {
    if (c == '\n') {
      frames.emplace_back();
    } else {
      frames.back() += c;
    }
  }
  PALPATE_REQUIRE(palpate::judge(frames, kAllowed).status != "200");
  return 0;
}
