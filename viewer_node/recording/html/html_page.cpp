// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/html/html_page.h"

// the file of report_assets.S
extern "C" const char palpate_report_css[], palpate_report_css_end[];

namespace palpate {

std::string html_escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
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
