// SPDX-License-Identifier: Apache-2.0
// open_page.h — the page of a viewer_node, open in a headless Chromium.
#pragma once

#include <optional>
#include <string>

#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_client.h"

namespace palpate::bench {

/// The browser starts with the constructor and ends with the object.
class OpenPage {
 public:
  /// Why there can be no page; "" if there can.
  [[nodiscard]] static std::string missing();

  /// Waits until the page draws. Throws SetupError if it does not.
  explicit OpenPage(const std::string& url);
  ~OpenPage();

  /// Pictures drawn so far.
  [[nodiscard]] double frames();

 private:
  test::TempFolder profile_;  // outlives the browser
  std::optional<test::Program> browser_;
  std::optional<test::WebClient> tools_;  // the browser's DevTools protocol
};

}  // namespace palpate::bench
