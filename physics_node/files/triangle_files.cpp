// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/triangle_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <vector>

#include "physics_node/files/file_text.h"

namespace palpate::physics {
namespace {

void check(const TriangleMesh& mesh, const std::string& file_name) {
  const std::string complaint = complaint_about(mesh);
  if (!complaint.empty()) throw SetupError(file_name + ": " + complaint);
}

/// Index, from 0, of the vertex of a corner "7", "7/1", "7//3" or "-1".
std::uint32_t corner_index(std::string_view word, std::size_t vertices, const FileText& text,
                           int line) {
  const std::string_view number = word.substr(0, word.find('/'));
  std::int64_t index = 0;
  const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), index);
  const auto count = static_cast<std::int64_t>(vertices);
  if (index < 0) index += count + 1;
  if (error != std::errc() || stop != number.data() + number.size() || index < 1 || index > count) {
    text.fail_at_line(line, "corner '" + shown_word(word) +
                                "': must be the number of a vertex before it, 1 … " +
                                std::to_string(count));
  }
  return static_cast<std::uint32_t>(index - 1);
}

/// A mesh in which corners with equal coordinates share a vertex.
TriangleMesh merged(const std::vector<Vector3>& corners) {
  std::vector<std::uint32_t> order(corners.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) {
    return std::tuple(corners[i].x(), corners[i].y(), corners[i].z(), i);
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  TriangleMesh mesh;
  std::vector<std::uint32_t> vertex_of(corners.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || corners[order[i]] != corners[order[i - 1]]) {
      mesh.vertices_m.push_back(corners[order[i]]);
    }
    vertex_of[order[i]] = static_cast<std::uint32_t>(mesh.vertices_m.size() - 1);
  }
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    mesh.triangles.push_back({vertex_of[i], vertex_of[i + 1], vertex_of[i + 2]});
  }
  return mesh;
}

std::vector<Vector3> binary_corners(std::string_view bytes, const std::string& file_name) {
  FileText text(bytes, file_name);
  text.skip_bytes(80, "header");
  const auto count = text.binary<std::uint32_t>("number of triangles", std::endian::little);
  std::vector<Vector3> corners;
  corners.reserve(3 * std::size_t{count});
  for (std::uint32_t t = 0; t < count; ++t) {
    text.skip_bytes(3 * sizeof(float), "normal");
    for (int corner = 0; corner < 3; ++corner) {
      Vector3 place;
      for (int axis = 0; axis < 3; ++axis) {
        place[axis] = static_cast<double>(text.binary<float>("corner", std::endian::little));
      }
      if (!place.allFinite()) {
        text.fail_at_byte("triangle " + std::to_string(t + 1) + ": its corners must be finite");
      }
      corners.push_back(place);
    }
    text.skip_bytes(sizeof(std::uint16_t), "attribute");
  }
  return corners;
}

std::vector<Vector3> ascii_corners(std::string_view bytes, const std::string& file_name) {
  FileText text(bytes, file_name);
  std::vector<Vector3> corners;
  const auto expect = [&](std::string_view keyword) {
    const std::string_view word = text.word();
    if (word != keyword) {
      text.fail("'" + shown_word(word) + "': must be '" + std::string(keyword) + "'");
    }
  };
  expect("solid");
  text.rest_of_line();
  while (true) {
    const std::string_view word = text.word();
    if (word == "endsolid") break;
    if (word != "facet") text.fail("'" + shown_word(word) + "': must be 'facet' or 'endsolid'");
    text.rest_of_line();
    expect("outer");
    expect("loop");
    for (int corner = 0; corner < 3; ++corner) {
      expect("vertex");
      const double x = text.number("x");
      const double y = text.number("y");
      const double z = text.number("z");
      corners.emplace_back(x, y, z);
    }
    expect("endloop");
    expect("endfacet");
  }
  return corners;
}

}  // namespace

TriangleMesh parse_obj(std::string_view bytes, const std::string& file_name) {
  FileText text(bytes, file_name);
  TriangleMesh mesh;
  while (!text.is_at_end()) {
    const int line = text.line();
    const std::string_view keyword = text.word_of_line();
    if (keyword == "v") {
      Vector3 place;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view word = text.word_of_line();
        if (!read_number(word, place[axis])) {
          text.fail_at_line(line, "coordinate '" + shown_word(word) +
                                      "': a vertex must have three finite numbers");
        }
      }
      mesh.vertices_m.push_back(place);
    } else if (keyword == "f") {
      std::vector<std::uint32_t> corners;
      for (std::string_view word = text.word_of_line(); !word.empty(); word = text.word_of_line()) {
        corners.push_back(corner_index(word, mesh.vertices_m.size(), text, line));
      }
      if (corners.size() < 3) text.fail_at_line(line, "a face must have three corners or more");
      for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
        mesh.triangles.push_back({corners[0], corners[i], corners[i + 1]});
      }
    }
    text.rest_of_line();
  }
  check(mesh, file_name);
  return mesh;
}

TriangleMesh parse_stl(std::string_view bytes, const std::string& file_name) {
  // a binary file may begin with "solid" too, so its length decides
  constexpr std::size_t kHeaderBytes = 84;
  constexpr std::size_t kTriangleBytes = 50;
  bool is_binary = !bytes.starts_with("solid");
  if (bytes.size() >= kHeaderBytes) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + 80, sizeof(count));
    static_assert(std::endian::native == std::endian::little);
    is_binary = is_binary || bytes.size() == kHeaderBytes + kTriangleBytes * std::size_t{count};
    if (is_binary && bytes.size() < kHeaderBytes + kTriangleBytes * std::size_t{count}) {
      throw SetupError(file_name + ": has " + std::to_string(bytes.size()) +
                       " bytes, too few for " + std::to_string(count) +
                       " triangles; is the file complete?");
    }
  }
  TriangleMesh mesh =
      merged(is_binary ? binary_corners(bytes, file_name) : ascii_corners(bytes, file_name));
  check(mesh, file_name);
  return mesh;
}

}  // namespace palpate::physics
