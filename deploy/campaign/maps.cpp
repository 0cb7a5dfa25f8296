// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/maps.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "common/core/check.h"
#include "common/process/terminal.h"

namespace palpate::campaign {
namespace {

/// One map: a number for each place, row by row; NaN where no run is known.
struct Map {
  std::string title;
  std::vector<double> numbers;
};

struct Maps {
  std::string across;
  std::string down;
  std::vector<std::string> columns;
  std::vector<std::string> rows;
  std::string quantity;
  std::vector<Map> maps;
};

struct Merged {
  double sum = 0.0;
  double least = std::numeric_limits<double>::infinity();
  double greatest = -std::numeric_limits<double>::infinity();
  std::uint64_t count = 0;

  void add(double value) {
    sum += value;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
    ++count;
  }
  [[nodiscard]] double number(Merge merge) const {
    if (count == 0) return kNaN;
    if (merge == Merge::kLeast) return least;
    return merge == Merge::kGreatest ? greatest : sum / static_cast<double>(count);
  }
};

/// Index of the dimension; the number of dimensions if there is none and none is named.
std::size_t dimension_of(const Campaign& campaign, const std::string& name, std::size_t other) {
  const auto& all = campaign.dimensions;
  for (std::size_t i = all.size(); i-- > 0;) {
    if (all[i].kind != Dimension::Kind::kCartesian || i == other) continue;
    if (name.empty() || all[i].name == name) return i;
  }
  if (name.empty()) return all.size();
  throw SetupError("\"" + name +
                   "\": the campaign has no other dimension of that name with values " +
                   "or options");
}

std::size_t quantity_of(const Campaign& campaign, const std::string& name) {
  std::string names;
  for (std::size_t i = 0; i < campaign.quantities.size(); ++i) {
    if (name.empty() || name == campaign.quantities[i]->name) return i;
    names += (names.empty() ? "" : ", ") + std::string(campaign.quantities[i]->name);
  }
  throw SetupError("\"" + name + "\" is not reported by the campaign; it has " + names);
}

std::vector<std::string> labels_of(const Campaign& campaign, std::size_t dimension) {
  if (dimension == campaign.dimensions.size()) return {""};
  std::vector<std::string> labels;
  for (const Value& value : campaign.dimensions[dimension].values) labels.push_back(value.label);
  return labels;
}

Maps maps_of(const Campaign& campaign, const Results& results, const MapRequest& request) {
  const std::size_t none = campaign.dimensions.size();
  std::size_t named_down = none;
  if (!request.down.empty()) named_down = dimension_of(campaign, request.down, none);
  const std::size_t across = dimension_of(campaign, request.across, named_down);
  const std::size_t down = dimension_of(campaign, request.down, across);
  const std::size_t quantity = quantity_of(campaign, request.quantity);
  const auto name_of = [&](std::size_t i) { return i == none ? "" : campaign.dimensions[i].name; };
  Maps maps{.across = name_of(across),
            .down = name_of(down),
            .columns = labels_of(campaign, across),
            .rows = labels_of(campaign, down),
            .quantity = campaign.quantities[quantity]->name,
            .maps = {}};

  // cell by cell: the last dimension varies fastest
  std::vector<std::vector<Merged>> merged;
  std::map<std::string, std::size_t> index_of;
  for (std::uint64_t cell = 0; cell < campaign.cells(); ++cell) {
    std::size_t column = 0;
    std::size_t row = 0;
    std::string title;
    std::uint64_t rest = cell;
    for (std::size_t i = none; i-- > 0;) {
      const Dimension& dimension = campaign.dimensions[i];
      if (dimension.kind != Dimension::Kind::kCartesian) continue;
      const std::size_t value = rest % dimension.values.size();
      rest /= dimension.values.size();
      if (i == across) {
        column = value;
      } else if (i == down) {
        row = value;
      } else {
        title = fmt::format("{} {}{}{}", dimension.name, dimension.values[value].label,
                            title.empty() ? "" : ", ", title);
      }
    }
    const auto [place, is_new] = index_of.emplace(title, maps.maps.size());
    if (is_new) {
      maps.maps.push_back({.title = title, .numbers = {}});
      merged.emplace_back(maps.rows.size() * maps.columns.size());
    }
    Merged& into = merged[place->second][row * maps.columns.size() + column];
    for (std::uint64_t i = 0; i < campaign.runs_per_cell; ++i) {
      const std::uint64_t run = cell * campaign.runs_per_cell + i;
      if (run >= results.needed() || !results.has(run)) continue;
      const double figure = results.figures(run)[quantity];
      if (std::isfinite(figure)) into.add(figure);
    }
  }
  for (std::size_t i = 0; i < merged.size(); ++i) {
    for (const Merged& one : merged[i]) maps.maps[i].numbers.push_back(one.number(request.merge));
  }
  return maps;
}

std::string shown(double number) {
  return std::isfinite(number) ? fmt::format("{:.4g}", number) : std::string("–");
}

std::string padded(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, columns_of(text)), ' ') + text;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

std::string map_text(const Campaign& campaign, const Results& results, const MapRequest& request) {
  const Maps maps = maps_of(campaign, results, request);
  std::string text;
  for (const Map& map : maps.maps) {
    text += fmt::format("{}{}{}\n", maps.quantity, map.title.empty() ? "" : ": ", map.title);
    std::size_t width = 8;
    for (const std::string& column : maps.columns) width = std::max(width, columns_of(column));
    std::size_t first = columns_of(maps.down);
    for (const std::string& row : maps.rows) first = std::max(first, columns_of(row));
    if (!maps.across.empty()) text += padded("", first) + "  " + maps.across + "\n";
    text += padded(maps.down, first);
    for (const std::string& column : maps.columns) text += "  " + padded(column, width);
    text += "\n";
    for (std::size_t row = 0; row < maps.rows.size(); ++row) {
      text += padded(maps.rows[row], first);
      for (std::size_t column = 0; column < maps.columns.size(); ++column) {
        text += "  " + padded(shown(map.numbers[row * maps.columns.size() + column]), width);
      }
      text += "\n";
    }
    text += "\n";
  }
  return text;
}

std::string map_svg(const Campaign& campaign, const Results& results, const MapRequest& request) {
  constexpr int kCell = 56;
  constexpr int kLine = 22;
  constexpr int kLeft = 110;
  const Maps maps = maps_of(campaign, results, request);
  double least = std::numeric_limits<double>::infinity();
  double greatest = -least;
  for (const Map& map : maps.maps) {
    for (const double number : map.numbers) {
      if (!std::isfinite(number)) continue;
      least = std::min(least, number);
      greatest = std::max(greatest, number);
    }
  }
  const auto shade = [&](double number) {
    const double ratio = greatest > least ? (number - least) / (greatest - least) : 0.5;
    return fmt::format("hsl(210,45%,{:.0f}%)", 30.0 + 60.0 * ratio);
  };
  const int columns = static_cast<int>(maps.columns.size());
  const int rows = static_cast<int>(maps.rows.size());
  const int height = (rows + 1) * kLine + 3 * kLine;
  std::string body;
  int y = 0;
  const auto write = [&](int x, int at, const char* anchor, const char* fill,
                         const std::string& text) {
    body += fmt::format("<text x='{}' y='{}' text-anchor='{}' fill='{}'>{}</text>\n", x, at, anchor,
                        fill, escaped(text));
  };
  for (const Map& map : maps.maps) {
    write(4, y + kLine - 6, "start", "black",
          maps.quantity + (map.title.empty() ? "" : ": " + map.title));
    write(4, y + 3 * kLine - 6, "start", "black", maps.down);
    write(kLeft, y + 2 * kLine - 6, "start", "black", maps.across);
    for (int column = 0; column < columns; ++column) {
      write(kLeft + column * kCell + kCell / 2, y + 3 * kLine - 6, "middle", "black",
            maps.columns[static_cast<std::size_t>(column)]);
    }
    for (int row = 0; row < rows; ++row) {
      const int top = y + (3 + row) * kLine;
      write(kLeft - 6, top + kLine - 6, "end", "black", maps.rows[static_cast<std::size_t>(row)]);
      for (int column = 0; column < columns; ++column) {
        const double number = map.numbers[static_cast<std::size_t>(row) * maps.columns.size() +
                                          static_cast<std::size_t>(column)];
        if (!std::isfinite(number)) continue;
        const bool is_dark = number < 0.5 * (least + greatest);
        body += fmt::format("<rect x='{}' y='{}' width='{}' height='{}' fill='{}'/>\n",
                            kLeft + column * kCell, top, kCell - 1, kLine - 1, shade(number));
        write(kLeft + column * kCell + kCell / 2, top + kLine - 6, "middle",
              is_dark ? "white" : "black", shown(number));
      }
    }
    y += height;
  }
  return fmt::format(
             "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} "
             "{1}' "
             "font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' "
             "fill='white'/>\n",
             kLeft + columns * kCell + 8, y) +
         body + "</svg>\n";
}

}  // namespace palpate::campaign
