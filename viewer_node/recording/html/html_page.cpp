// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/html/html_page.h"

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "common/core/user/utf8.h"

// the file of report_assets.S
extern "C" const char palpate_report_css[], palpate_report_css_end[];

namespace palpate {

std::string html_escaped(const std::string& text) {
  std::string html;
  // the page says that it is UTF-8; names of files may be anything
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = utf8_character_at(std::string_view(text).substr(at)).length;
    if (length != 1) {
      html += length == 0 ? "\xEF\xBF\xBD" : text.substr(at, length);
      at += std::max<std::size_t>(1, length);
      continue;
    }
    const char c = text[at++];
    switch (c) {
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '&':
        html += "&amp;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string html_head(const std::string& title, const std::string& body_attributes) {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
         "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n<title>" +
         html_escaped(title) + "</title>\n<style>" +
         std::string(palpate_report_css, palpate_report_css_end) + "</style></head>\n<body" +
         (body_attributes.empty() ? "" : " " + body_attributes) + ">\n";
}

}  // namespace palpate
