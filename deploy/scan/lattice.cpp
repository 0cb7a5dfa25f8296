// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/lattice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "common/core/check.h"

namespace palpate::scan {
namespace {

using Place = std::array<std::int32_t, 3>;

/// A box of numbers, one per cube.
template <class T>
class Grid {
 public:
  Grid(Place size, T value)
      : size_(size), values_(number(size[0]) * number(size[1]) * number(size[2]), value) {}
  [[nodiscard]] bool has(const Place& p) const {
    for (std::size_t i = 0; i < 3; ++i) {
      if (p[i] < 0 || p[i] >= size_[i]) return false;
    }
    return true;
  }
  [[nodiscard]] T& at(const Place& p) {
    return values_[(number(p[2]) * number(size_[1]) + number(p[1])) * number(size_[0]) +
                   number(p[0])];
  }
  [[nodiscard]] T at(const Place& p) const { return const_cast<Grid*>(this)->at(p); }
  [[nodiscard]] const Place& size() const { return size_; }

  template <class Visit>
  void for_each(Visit visit) const {
    Place p{};
    for (p[2] = 0; p[2] < size_[2]; ++p[2]) {
      for (p[1] = 0; p[1] < size_[1]; ++p[1]) {
        for (p[0] = 0; p[0] < size_[0]; ++p[0]) visit(p);
      }
    }
  }

 private:
  static std::size_t number(std::int32_t i) { return static_cast<std::size_t>(i); }

  Place size_;
  std::vector<T> values_;
};
using Flags = Grid<char>;

/// True also for the 26 neighbours.
Flags dilated(const Flags& flags) {
  Flags result = flags;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Flags before = result;
    before.for_each([&](Place p) {
      if (before.at(p) == 0) return;
      for (const int step : {-1, 1}) {
        Place q = p;
        q[axis] += step;
        if (result.has(q)) result.at(q) = 1;
      }
    });
  }
  return result;
}

/// A cube of twice the edge is true if any of its eight is.
Flags halved(const Flags& flags) {
  Place size = flags.size();
  for (std::int32_t& length : size) length = (length + 1) / 2;
  Flags result(size, 0);
  flags.for_each([&](Place p) {
    if (flags.at(p) != 0) result.at({p[0] / 2, p[1] / 2, p[2] / 2}) = 1;
  });
  return result;
}

class LatticeMaker {
 public:
  explicit LatticeMaker(const Stuffing& stuffing)
      : stuffing_(stuffing), size_(size_of(stuffing)), level_(size_, 0), is_near_(size_, 0) {
    const Vector3 middle_m = 0.5 * (stuffing.bounds.lowest_m + stuffing.bounds.highest_m);
    for (int i = 0; i < 3; ++i)
      origin_m_[i] = middle_m[i] - 0.5 * stuffing.cell_m * size_[static_cast<std::size_t>(i)];
    find_levels();
  }

  Lattice take() {
    level_.for_each([&](Place p) {
      const int level = level_.at(p);
      const std::int32_t mask = (1 << level) - 1;
      if (((p[0] | p[1] | p[2]) & mask) == 0 && is_near(p, level)) add_leaf(p, level);
    });
    number_nodes();
    return std::move(lattice_);
  }

 private:
  [[nodiscard]] bool is_near(const Place& corner, int level) const {
    const std::int32_t cells = 1 << level;
    Place p{};
    for (p[2] = 0; p[2] < cells; ++p[2]) {
      for (p[1] = 0; p[1] < cells; ++p[1]) {
        for (p[0] = 0; p[0] < cells; ++p[0]) {
          if (is_near_.at({corner[0] + p[0], corner[1] + p[1], corner[2] + p[2]}) != 0) return true;
        }
      }
    }
    return false;
  }
  static Place size_of(const Stuffing& stuffing) {
    const Vector3 extent_m = stuffing.bounds.highest_m - stuffing.bounds.lowest_m;
    const std::int32_t step = 1 << stuffing.coarsest;
    Place size{};
    double cubes = 1.0;
    for (int i = 0; i < 3; ++i) {
      // a cube more on each side, and more where it is coarse, so that all of the body is covered
      const double length = std::ceil(extent_m[i] / stuffing.cell_m) + 2.0 * step;
      cubes *= length;
      if (!(cubes <= kMostCubes)) {
        char text[64];  // NOLINT: for snprintf
        std::snprintf(text, sizeof text, "%.3g mm", 1e3 * stuffing.cell_m);
        throw SetupError(std::string("cells of ") + text +
                         " are too many for this body: at most 30 million; make them larger");
      }
      size[static_cast<std::size_t>(i)] =
          (static_cast<std::int32_t>(length) + step - 1) / step * step;
    }
    return size;
  }

  /// In halves of a cell.
  [[nodiscard]] Vector3 place_m(const Place& half) const {
    return origin_m_ + 0.5 * stuffing_.cell_m * Vector3(half[0], half[1], half[2]);
  }

  void find_levels() {
    Flags is_in({size_[0] + 1, size_[1] + 1, size_[2] + 1}, 0);
    is_in.for_each([&](Place p) {
      is_in.at(p) = stuffing_.inside(place_m({2 * p[0], 2 * p[1], 2 * p[2]})) > 0.0 ? 1 : 0;
    });
    // cubes with nodes on both sides of the surface, and those with one inside
    Flags is_touched(size_, 0);
    Grid<signed char> coarsest(size_, static_cast<signed char>(stuffing_.coarsest));
    is_touched.for_each([&](Place p) {
      const Vector3 centre_m = place_m({2 * p[0] + 1, 2 * p[1] + 1, 2 * p[2] + 1});
      int inner = stuffing_.inside(centre_m) > 0.0 ? 1 : 0;
      for (int corner = 0; corner < 8; ++corner) {
        inner += is_in.at({p[0] + (corner & 1), p[1] + (corner >> 1 & 1), p[2] + (corner >> 2)});
      }
      if (inner == 0) return;
      is_touched.at(p) = 1;
      int level = stuffing_.coarsest;
      if (stuffing_.coarsest_at) level = std::min(level, stuffing_.coarsest_at(centre_m));
      if (inner < 9) {
        level = std::min(
            level, stuffing_.coarsest_at_surface ? stuffing_.coarsest_at_surface(centre_m) : 0);
      }
      coarsest.at(p) = static_cast<signed char>(level);
    });
    is_near_ = dilated(is_touched);

    // splits[n]: cubes of level n + 1 that are divided, because something in or beside them is
    // finer
    std::vector<Flags> splits;
    for (int level = 1; level <= stuffing_.coarsest; ++level) {
      Flags is_finer(size_, 0);
      is_finer.for_each([&](Place p) { is_finer.at(p) = coarsest.at(p) < level ? 1 : 0; });
      // a ring of equal cubes around, so that what is cut is regular
      Flags split = dilated(is_finer);
      for (int n = 0; n < level; ++n) split = halved(split);
      if (level > 1) {
        const Flags below = halved(dilated(splits.back()));
        split.for_each([&](Place p) { split.at(p) |= below.at(p); });
      }
      splits.push_back(split);
    }
    level_.for_each([&](Place p) {
      int level = 0;
      while (level < stuffing_.coarsest &&
             splits[static_cast<std::size_t>(level)].at(
                 {p[0] >> (level + 1), p[1] >> (level + 1), p[2] >> (level + 1)}) == 0) {
        ++level;
      }
      level_.at(p) = static_cast<signed char>(level);
    });
  }

  /// The tetrahedra of a leaf with its neighbours, each pair of equal leaves once.
  void add_leaf(const Place& corner, int level) {
    const std::int32_t cells = 1 << level;
    const Place centre{2 * corner[0] + cells, 2 * corner[1] + cells, 2 * corner[2] + cells};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t u = (axis + 1) % 3;
      const std::size_t v = (axis + 2) % 3;
      for (const int side : {-1, 1}) {
        Place beside = corner;
        beside[axis] += side > 0 ? cells : -1;
        if (!level_.has(beside)) continue;
        const int other = level_.at(beside);
        // corners of the face, round its middle
        Place middle = centre;
        middle[axis] += side * cells;
        std::array<Place, 4> face{middle, middle, middle, middle};
        for (std::size_t i = 0; i < 4; ++i) {
          face[i][u] += i == 0 || i == 3 ? -cells : cells;
          face[i][v] += i < 2 ? -cells : cells;
        }
        if (other > level) {
          // the face is a quarter of the neighbour's; cut from the middle of that one
          const std::int32_t large = 4 * cells;
          std::size_t shared = 0;  // the corner in the middle of the neighbour's face
          for (std::size_t i = 0; i < 4; ++i) {
            if (face[i][u] % large != 0 && face[i][v] % large != 0) shared = i;
          }
          add({centre, face[shared], face[(shared + 1) % 4], face[(shared + 2) % 4]}, false);
          add({centre, face[shared], face[(shared + 2) % 4], face[(shared + 3) % 4]}, false);
        } else if (other < level) {
          for (std::size_t i = 0; i < 4; ++i) {
            const Place between = half_way(face[i], face[(i + 1) % 4]);
            add({centre, middle, face[i], between}, false);
            add({centre, middle, between, face[(i + 1) % 4]}, false);
          }
        } else if (side > 0) {
          Place far = centre;
          far[axis] += 2 * cells;
          for (std::size_t i = 0; i < 4; ++i) {
            // the edge has a node in its middle if a leaf beyond it is smaller
            const bool is_along_u = i % 2 == 0;  // faces 0–1 and 2–3 run along u
            const std::size_t across = is_along_u ? v : u;
            const int step = (is_along_u ? i == 0 : i == 3) ? -1 : 1;
            bool is_divided = false;
            for (Place cell : {corner, beside}) {
              cell[across] += step > 0 ? cells : -1;
              is_divided = is_divided || (level_.has(cell) && level_.at(cell) < level);
            }
            const Place& from = face[i];
            const Place& to = face[(i + 1) % 4];
            if (is_divided) {
              add({centre, far, from, half_way(from, to)}, false);
              add({centre, far, half_way(from, to), to}, false);
            } else {
              add({centre, far, from, to}, true);
            }
          }
        }
      }
    }
  }

  static Place half_way(const Place& a, const Place& b) {
    return {(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2};
  }

  void add(const std::array<Place, 4>& corners, bool is_regular) {
    const auto edge = [&](std::size_t i) {
      return Vector3(corners[i][0] - corners[0][0], corners[i][1] - corners[0][1],
                     corners[i][2] - corners[0][2]);
    };
    std::array<std::uint64_t, 4> keys{};
    for (std::size_t i = 0; i < 4; ++i) keys[i] = key_of(corners[i]);
    if (edge(1).cross(edge(2)).dot(edge(3)) < 0.0) std::swap(keys[0], keys[1]);
    if (keys_.size() >= kMostElements) {
      throw SetupError("the lattice has more than 6 million tetrahedra; make its cells larger");
    }
    keys_.push_back(keys);
    if (!is_regular) irregular_.insert(irregular_.end(), keys.begin(), keys.end());
  }
  static constexpr std::size_t kMostElements = 6'000'000;
  static constexpr int kBits = 21;
  static std::uint64_t key_of(const Place& p) {
    std::uint64_t key = 0;
    for (std::size_t i = 3; i-- > 0;) key = key << kBits | static_cast<std::uint64_t>(p[i]);
    return key;
  }
  static Place place_of(std::uint64_t key) {
    constexpr std::uint64_t kMask = (1ULL << kBits) - 1;
    return {static_cast<std::int32_t>(key & kMask), static_cast<std::int32_t>(key >> kBits & kMask),
            static_cast<std::int32_t>(key >> 2 * kBits & kMask)};
  }

  /// Nodes in the order of their places.
  void number_nodes() {
    std::vector<std::uint64_t> nodes;
    nodes.reserve(4 * keys_.size());
    for (const auto& keys : keys_) nodes.insert(nodes.end(), keys.begin(), keys.end());
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (const std::uint64_t key : nodes) {
      lattice_.places.push_back(place_of(key));
      lattice_.nodes_m.push_back(place_m(lattice_.places.back()));
    }
    const auto number = [&](std::uint64_t key) {
      return static_cast<std::uint32_t>(std::lower_bound(nodes.begin(), nodes.end(), key) -
                                        nodes.begin());
    };
    lattice_.is_regular.assign(nodes.size(), true);
    for (const std::uint64_t key : irregular_) lattice_.is_regular[number(key)] = false;
    for (const auto& keys : keys_) {
      std::array<std::uint32_t, 4> corners{};
      for (std::size_t i = 0; i < 4; ++i) corners[i] = number(keys[i]);
      lattice_.tetrahedra.push_back(corners);
    }
  }

  const Stuffing& stuffing_;
  Place size_;
  Grid<signed char> level_;
  Flags is_near_;  // to the body: elsewhere no elements are needed
  Vector3 origin_m_ = Vector3::Zero();
  std::vector<std::array<std::uint64_t, 4>> keys_;  // of the elements' nodes
  std::vector<std::uint64_t> irregular_;            // nodes
  Lattice lattice_;
};

}  // namespace

Lattice lattice_of(const Stuffing& stuffing) { return LatticeMaker(stuffing).take(); }

}  // namespace palpate::scan
