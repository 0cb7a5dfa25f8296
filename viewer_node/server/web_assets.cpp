// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/web_assets.h"

#include <array>
#include <cstdint>
#include <string>

#include "common/core/random.h"

// web_assets.S: the files of the page, as built, one after the other.
extern "C" {
extern const char palpate_index_html[];
extern const char palpate_index_html_end[];
extern const char palpate_app_js_gz[];
extern const char palpate_app_js_gz_end[];
extern const char palpate_app_css_gz[];
extern const char palpate_app_css_gz_end[];
}

namespace palpate::viewer {
namespace {

/// FNV-1a of the content, quoted.
std::string etag_of(std::string_view bytes) { return '"' + std::to_string(fnv1a(bytes)) + '"'; }

struct Assets {
  std::array<std::string, 3> etags;
  std::array<WebAsset, 3> all;
  std::size_t count = 0;

  void add(std::string_view path, std::string_view type, const char* begin, const char* end,
           bool is_gzip) {
    const std::string_view bytes(begin, static_cast<std::size_t>(end - begin));
    if (bytes.empty()) return;  // a build without the page has the notice only
    etags[count] = etag_of(bytes);
    all[count] = {path, type, bytes, is_gzip, etags[count]};
    ++count;
  }
};

}  // namespace

std::span<const WebAsset> web_assets() {
  static const Assets assets = [] {
    Assets a;
    a.add("/", "text/html; charset=utf-8", palpate_index_html, palpate_index_html_end, false);
    a.add("/app.js", "text/javascript; charset=utf-8", palpate_app_js_gz, palpate_app_js_gz_end,
          true);
    a.add("/app.css", "text/css; charset=utf-8", palpate_app_css_gz, palpate_app_css_gz_end, true);
    return a;
  }();
  return {assets.all.data(), assets.count};
}

}  // namespace palpate::viewer
