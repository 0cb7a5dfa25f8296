// SPDX-License-Identifier: Apache-2.0
// web_assets.h — the page, embedded in the program. CMake option PALPATE_WEB.
#pragma once

#include <span>
#include <string_view>

namespace palpate::viewer {

struct WebAsset {
  std::string_view path;  ///< in the URL: "/app.js"
  std::string_view content_type;
  std::string_view bytes;
  bool is_gzip = false;
  std::string_view etag;  ///< quoted; changes with the content
};

/// All served files; "/" is the page or, in a build without npm, a notice.
[[nodiscard]] std::span<const WebAsset> web_assets();

}  // namespace palpate::viewer
