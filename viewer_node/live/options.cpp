// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/options.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <system_error>

#include "common/core/check.h"
#include "common/core/user/files.h"

namespace palpate::viewer {
namespace {

constexpr std::size_t kMinTokenBytes = 16;
constexpr std::uintmax_t kMaxTokenFileBytes = 4096;

/// "127.0.0.1:8765", "[::1]:0", "localhost:8765".
void read_listen(const std::string& listen, WebServerConfig& config) {
  const std::size_t colon = listen.rfind(':');
  std::string address = listen.substr(0, colon);
  if (address == "localhost") address = "127.0.0.1";
  if (address.starts_with('[') && address.ends_with(']')) {
    address = address.substr(1, address.size() - 2);
  }
  const char* const last = listen.data() + listen.size();
  std::uint16_t port = 0;
  const auto [stop, error] = colon == std::string::npos
                                 ? std::from_chars_result{last, std::errc::invalid_argument}
                                 : std::from_chars(listen.data() + colon + 1, last, port);
  if (error != std::errc() || stop != last || address.empty()) {
    throw SetupError("--listen " + listen + ": give ADDRESS:PORT, such as 127.0.0.1:8765");
  }
  config.address = address;
  config.port = port;
}

std::string read_token(const std::string& file) {
  const FileContent content = read_text_file(file, kMaxTokenFileBytes);
  if (!content.complaint.empty()) {
    throw SetupError("--token-file " + file + ": " + content.complaint);
  }
  if (const std::string why = why_exposed(file, true); !why.empty()) {
    throw SetupError("--token-file " + file + ": " + why);
  }
  std::string token = content.bytes;
  while (!token.empty() && (token.back() == '\n' || token.back() == '\r')) token.pop_back();
  const bool is_plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
  });
  if (token.size() < kMinTokenBytes || !is_plain) {
    throw SetupError("--token-file " + file +
                     ": must hold one line of at least 16 letters, digits, '-' and '_'; make one "
                     "with: openssl rand -hex 16");
  }
  return token;
}

}  // namespace

bool is_loopback(const std::string& address) {
  in_addr v4{};
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  if (inet_pton(AF_INET6, address.c_str(), &v6) != 1) return false;
  return IN6_IS_ADDR_LOOPBACK(&v6) || (IN6_IS_ADDR_V4MAPPED(&v6) && v6.s6_addr[12] == 127);
}

WebServerConfig web_config(const WebOptions& options, const WebConfig& session) {
  WebServerConfig config{.port = session.port, .may_move = true};
  if (!options.listen.empty()) {
    read_listen(options.listen, config);
    config.may_move = false;
  }
  config.descriptor = options.descriptor;
  config.rules.origins = options.origins;
  config.rules.hosts = options.hosts;
  config.proxies = options.proxies;
  config.audience = options.audience;
  config.record_folder = page_record_folder(options);
  if (!options.token_file.empty()) config.rules.token = read_token(options.token_file);
  if (!is_loopback(config.address) && config.rules.token.empty()) {
    throw SetupError("--listen " + options.listen +
                     ": other machines could observe the session; give --token-file FILE, or "
                     "listen on 127.0.0.1");
  }
  return config;
}

std::string page_record_folder(const WebOptions& options) {
  if (options.audience > 0) return "";
  if (options.record_folder) return *options.record_folder;
  WebServerConfig config;
  if (!options.listen.empty()) read_listen(options.listen, config);
  return is_loopback(config.address) ? "." : "";
}

}  // namespace palpate::viewer
