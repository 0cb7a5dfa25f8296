// SPDX-License-Identifier: Apache-2.0
// body_compliance.h — how the surface of an elastic body gives way: for all simulations of the
// body.
#pragma once

#include <filesystem>
#include <memory>

#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

/// The compliance of a body, and the factor by which it is made; both are made where the body is
/// touched first. Thread-safe as elastic::SurfaceCompliance is.
class BodyCompliance {
 public:
  /// @param columns_folder  where the columns of the compliance are kept between runs, a file for
  ///     each body; empty: nowhere. What cannot be read or written is made anew
  explicit BodyCompliance(std::shared_ptr<const ElasticBody> body,
                          const std::filesystem::path& columns_folder = {});
  /// @param remade  with its factor, if that is known
  explicit BodyCompliance(const RemadeBody& remade);
  ~BodyCompliance();
  BodyCompliance(const BodyCompliance&) = delete;
  BodyCompliance& operator=(const BodyCompliance&) = delete;

  [[nodiscard]] const std::shared_ptr<const ElasticBody>& body() const noexcept { return body_; }
  [[nodiscard]] elastic::SurfaceCompliance& compliance() noexcept { return compliance_; }

 private:
  std::shared_ptr<const ElasticBody> body_;
  elastic::WarpedFactor factor_;  // of the undeformed body, made when a column is needed
  elastic::SurfaceCompliance compliance_;
  std::filesystem::path columns_file_;  // empty: not kept
};

}  // namespace palpate::physics
