// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/body_compliance.h"

#include <exception>
#include <utility>

#include "physics_node/elastic/condensed/compliance_file.h"

namespace palpate::physics {

namespace {

elastic::Precision precision_of(const ElasticBody& body) {
  return body.slow_modes.count() > 0 ? elastic::Precision::kDouble : elastic::Precision::kFloat;
}

}  // namespace

BodyCompliance::BodyCompliance(const RemadeBody& remade)
    : body_(remade.body),
      factor_(remade.at_rest ? remade.at_rest->in(precision_of(*body_))
                             : elastic::WarpedFactor(*body_->body, precision_of(*body_))),
      compliance_(*body_->body, factor_, body_->surface_nodes) {}

BodyCompliance::BodyCompliance(std::shared_ptr<const ElasticBody> body,
                               const std::filesystem::path& columns_folder)
    : body_(std::move(body)),
      factor_(*body_->body, precision_of(*body_)),
      compliance_(*body_->body, factor_, body_->surface_nodes) {
  if (columns_folder.empty()) return;
  columns_file_ = elastic::compliance_file(columns_folder, compliance_);
  static_cast<void>(elastic::load_columns(columns_file_, compliance_));
}

BodyCompliance::~BodyCompliance() {
  if (columns_file_.empty() || compliance_.columns_made() == 0) return;
  try {
    std::filesystem::create_directories(columns_file_.parent_path());
    elastic::save_columns(compliance_, columns_file_);
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the next run makes them anew
  }
}

}  // namespace palpate::physics
