// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/smooth_field.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

#include "common/core/check.h"

namespace palpate::scan {
namespace {

// Half of the values that a low pass looks at, in widths.
constexpr double kReach = 3.0;
// A centre that the low pass has put on the wrong side comes back by this much.
constexpr float kMargin = 0.05F;

std::vector<float> gaussian(double width) {
  const int reach = std::max(1, static_cast<int>(std::ceil(kReach * width)));
  std::vector<float> weights;
  double sum = 0.0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * i * i / (width * width))));
    sum += static_cast<double>(weights.back());
  }
  for (float& weight : weights) weight = static_cast<float>(static_cast<double>(weight) / sum);
  return weights;
}

/// Along one axis; beyond the border the outside goes on. Lines are done 64 at a time, side by
/// side, so that the compiler can use vectors.
void convolve(std::vector<float>& values, const std::array<std::int64_t, 3>& size, std::size_t axis,
              const std::vector<float>& weights) {
  constexpr std::int64_t kTogether = 64;
  const std::int64_t length = size[axis];
  const std::int64_t reach = static_cast<std::int64_t>(weights.size()) / 2;
  std::int64_t inner = 1;
  for (std::size_t i = 0; i < axis; ++i) inner *= size[i];
  const std::int64_t lines = static_cast<std::int64_t>(values.size()) / length;
  std::vector<float> block(static_cast<std::size_t>((length + 2 * reach) * kTogether), -1.0F);
  std::array<float*, kTogether> begins{};
  for (std::int64_t first = 0; first < lines; first += kTogether) {
    const std::int64_t count = std::min(kTogether, lines - first);
    for (std::int64_t c = 0; c < count; ++c) {
      const std::int64_t line = first + c;
      begins[static_cast<std::size_t>(c)] =
          values.data() + line / inner * inner * length + line % inner;
    }
    for (std::int64_t n = 0; n < length; ++n) {
      float* const to = block.data() + (n + reach) * kTogether;
      for (std::int64_t c = 0; c < count; ++c)
        to[c] = begins[static_cast<std::size_t>(c)][n * inner];
    }
    for (std::int64_t n = 0; n < length; ++n) {
      std::array<float, kTogether> sum{};
      for (std::size_t w = 0; w < weights.size(); ++w) {
        const float weight = weights[w];
        const float* const from = block.data() + (n + static_cast<std::int64_t>(w)) * kTogether;
        for (std::size_t c = 0; c < kTogether; ++c) sum[c] += weight * from[c];
      }
      for (std::int64_t c = 0; c < count; ++c) {
        begins[static_cast<std::size_t>(c)][n * inner] = sum[static_cast<std::size_t>(c)];
      }
    }
  }
}

}  // namespace

void SmoothField::smooth(const Vector3& widths, std::vector<float>& values) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    convolve(values, size_, axis, gaussian(widths[static_cast<Eigen::Index>(axis)]));
  }
}

SmoothField::SmoothField(const LabelMap& map, const std::vector<bool>& is_inside,
                         const Smoothing& smoothing) {
  const Vector3 spacing_m = map.spacing_m();
  const double width_m = smoothing.width_m > 0.0 ? smoothing.width_m : spacing_m.maxCoeff();
  const std::int64_t block = std::int64_t{1} << smoothing.coarsening;
  step_ = static_cast<double>(block);
  const Vector3 widths = width_m / step_ * spacing_m.cwiseInverse();

  std::array<std::int64_t, 3> low{map.size[0], map.size[1], map.size[2]};
  std::array<std::int64_t, 3> high{-1, -1, -1};
  const auto for_each = [&](auto visit) {
    std::size_t at = 0;
    for (std::int64_t k = 0; k < map.size[2]; ++k) {
      for (std::int64_t j = 0; j < map.size[1]; ++j) {
        for (std::int64_t i = 0; i < map.size[0]; ++i, ++at) {
          if (is_inside[map.voxels[at]]) visit(std::array{i, j, k});
        }
      }
    }
  };
  for_each([&](const std::array<std::int64_t, 3>& index) {
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], index[a]);
      high[a] = std::max(high[a], index[a]);
    }
  });
  PALPATE_REQUIRE(high[0] >= 0);
  std::array<std::int64_t, 3> first{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = static_cast<Eigen::Index>(a);
    lowest_[axis] = static_cast<double>(low[a]) - 0.5;
    highest_[axis] = static_cast<double>(high[a]) + 0.5;
    const auto margin = static_cast<std::int64_t>(std::ceil(2.0 * widths[axis])) + 2;
    first[a] = low[a] - block * margin;
    size_[a] = (high[a] - low[a]) / block + 1 + 2 * margin;
    first_[axis] = static_cast<double>(first[a]) + 0.5 * (step_ - 1.0);
  }

  // shares of voxels inside, as −1 … 1
  const float share = 2.0F / static_cast<float>(block * block * block);
  values_.assign(static_cast<std::size_t>(size_[0] * size_[1] * size_[2]), -1.0F);
  for_each([&](const std::array<std::int64_t, 3>& index) {
    std::int64_t at = 0;
    for (std::size_t a = 3; a-- > 0;) at = at * size_[a] + (index[a] - first[a]) / block;
    values_[static_cast<std::size_t>(at)] += share;
  });
  std::vector<char> sides;
  for (const float value : values_) sides.push_back(value > 0.999F ? 1 : value < -0.999F ? -1 : 0);

  std::vector<float> twice;
  for (int round = 0; round < smoothing.rounds; ++round) {
    smooth(widths, values_);
    twice = values_;
    smooth(widths, twice);
    for (std::size_t i = 0; i < values_.size(); ++i) {
      float value = std::clamp(2.0F * values_[i] - twice[i], -1.0F, 1.0F);
      if (round + 1 < smoothing.rounds) {
        if (sides[i] > 0) value = std::max(value, kMargin);
        if (sides[i] < 0) value = std::min(value, -kMargin);
      }
      values_[i] = value;
    }
  }
}

double SmoothField::level_of(double voxels, double largest) const {
  // each value stands for a cube of its own; those near the surface are looked at in eight places
  const double share = step_ * step_ * step_ / 8.0;
  const auto limit = static_cast<float>(largest);
  double inside = 0.0;
  std::vector<float> near;
  std::size_t index = 0;
  for (std::int64_t k = 0; k < size_[2]; ++k) {
    for (std::int64_t j = 0; j < size_[1]; ++j) {
      for (std::int64_t i = 0; i < size_[0]; ++i, ++index) {
        const float value = values_[index];
        if (value < -0.99F) continue;
        if (value > 0.99F) {
          inside += 8.0;
          continue;
        }
        for (int corner = 0; corner < 8; ++corner) {
          const Vector3 offset((corner & 1 ? 0.25 : -0.25), (corner & 2 ? 0.25 : -0.25),
                               (corner & 4 ? 0.25 : -0.25));
          const auto there = static_cast<float>(
              at(first_ + step_ * (Vector3(static_cast<double>(i), static_cast<double>(j),
                                           static_cast<double>(k)) +
                                   offset)));
          if (there > limit) {
            inside += 1.0;
          } else if (there >= -limit) {
            near.push_back(there);
          }
        }
      }
    }
  }
  if (near.empty()) return 0.0;
  const double wanted =
      std::clamp(voxels / share - inside, 0.0, static_cast<double>(near.size() - 1));
  const auto place = near.begin() + static_cast<std::ptrdiff_t>(wanted);
  std::nth_element(near.begin(), place, near.end(), std::greater<>());
  return static_cast<double>(*place);
}

double SmoothField::at(const Vector3& index) const noexcept {
  const Vector3 place = (index - first_) / step_;
  std::array<std::int64_t, 3> cell{};
  std::array<double, 3> part{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double p = place[static_cast<Eigen::Index>(a)];
    if (!(p >= 0.0 && p < static_cast<double>(size_[a] - 1))) return -1.0;
    cell[a] = static_cast<std::int64_t>(p);
    part[a] = p - static_cast<double>(cell[a]);
  }
  const float* const corner = values_.data() + (cell[2] * size_[1] + cell[1]) * size_[0] + cell[0];
  const auto along_i = [&](std::int64_t offset) {
    const auto first = static_cast<double>(corner[offset]);
    return first + part[0] * (static_cast<double>(corner[offset + 1]) - first);
  };
  const auto along_j = [&](std::int64_t offset) {
    const double first = along_i(offset);
    return first + part[1] * (along_i(offset + size_[0]) - first);
  };
  const double first = along_j(0);
  return first + part[2] * (along_j(size_[0] * size_[1]) - first);
}

}  // namespace palpate::scan
