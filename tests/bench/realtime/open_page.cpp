// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/realtime/open_page.h"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "common/core/check.h"

namespace palpate::bench {
namespace {

std::string chromium() {
  const char* const given = std::getenv("CHROMIUM");
  return given != nullptr ? given : "/usr/bin/chromium";
}

}  // namespace

std::string OpenPage::missing() {
  if (access(chromium().c_str(), X_OK) == 0) return "";
  return chromium() + " is not there (apt-get install chromium, or give $CHROMIUM)";
}

OpenPage::OpenPage(const std::string& url) {
  // as in tests/web/support/browser.mjs: WebGL on the processor, and no traffic of its own
  browser_.emplace(chromium(), std::vector<std::string>{
                                   "--headless", "--no-sandbox", "--disable-quic", "--no-first-run",
                                   "--disable-background-networking", "--disable-component-update",
                                   "--disable-sync", "--use-angle=swiftshader",
                                   "--enable-unsafe-swiftshader", "--disable-gpu-compositing",
                                   "--remote-debugging-port=0", "--window-size=1000,700",
                                   "--user-data-dir=" + profile_.path().string(), url});
  const std::string tools = browser_->await_err("DevTools listening on ws://127.0.0.1:");
  if (tools.empty()) throw SetupError("Chromium does not start:\n" + browser_->err());
  const auto port = static_cast<std::uint16_t>(std::stoi(tools));

  std::string target;
  test::await([&] {
    test::WebClient list(port);
    list.send_raw("GET /json/list HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const std::string answer = list.read_to_end();
    const std::size_t begin = answer.find("\r\n\r\n");
    if (begin == std::string::npos) return false;
    const auto pages = nlohmann::json::parse(answer.substr(begin), nullptr, false);
    if (!pages.is_array()) return false;
    for (const auto& page : pages) {
      if (page.value("type", "") == "page" && page.value("url", "").starts_with(url)) {
        target = page.value("webSocketDebuggerUrl", "");
      }
    }
    return !target.empty();
  });
  const std::size_t path = target.find("/devtools/");
  if (path == std::string::npos) throw SetupError("Chromium does not show " + url);
  tools_.emplace(port);
  tools_->send_raw(test::WebClient::upgrade({}, target.substr(path)));
  if (!tools_->read_head().starts_with("HTTP/1.1 101")) {
    throw SetupError("Chromium refuses its DevTools protocol");
  }
  if (!test::await([&] { return frames() > 0.0; })) throw SetupError(url + " draws nothing");
}

OpenPage::~OpenPage() {
  browser_->send_signal(SIGTERM);  // its own processes end with it
  browser_->wait();
}

double OpenPage::frames() {
  tools_->send_text(
      R"({"id":1,"method":"Runtime.evaluate","params":{"expression":"window.__test?.frames ?? 0"}})");
  const auto answer = nlohmann::json::parse(tools_->await_text(R"("id":1)"), nullptr, false);
  if (!answer.is_object()) throw SetupError("Chromium does not answer");
  return answer["result"]["result"].value("value", 0.0);
}

}  // namespace palpate::bench
