// SPDX-License-Identifier: Apache-2.0
// file_surface.h — a surface loaded from a file.
#pragma once

#include <cstddef>

#include "common/contact/bounds.h"
#include "common/contact/surface.h"

namespace palpate::physics {

/// In the frame of the file, in metres; shared by all tissues and tools that use it.
class FileSurface : public Surface {
 public:
  FileSurface() = default;
  FileSurface(const FileSurface&) = delete;
  FileSurface& operator=(const FileSurface&) = delete;

  /// Contains every point at which view() gives a distance ≤ 0.
  [[nodiscard]] virtual Bounds bounds() const noexcept = 0;

  /// Heap memory held.
  [[nodiscard]] virtual std::size_t bytes() const noexcept = 0;
};

}  // namespace palpate::physics
