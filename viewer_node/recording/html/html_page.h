// SPDX-License-Identifier: Apache-2.0
// html_page.h — what HTML files that stand alone have in common: they load nothing, and have the
// colours of the page, by day and by night.
#pragma once

#include <string>

namespace palpate {

/// For an element or a quoted attribute.
[[nodiscard]] std::string html_escaped(const std::string& text);
/// Up to and with <body …>, in which nothing is loaded from anywhere.
/// @param title            any text   @param body_attributes  HTML
[[nodiscard]] std::string html_head(const std::string& title,
                                    const std::string& body_attributes = "");

}  // namespace palpate
