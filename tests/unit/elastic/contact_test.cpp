// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/elastic/condensed/compliance_file.h"
#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/sphere_contact.h"
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"

namespace palpate::elastic {
namespace {

constexpr double kRadius = 0.005;
Vector3d sphere_at(double depth_m) { return {0.05, 0.05, 0.05 + kRadius - depth_m}; }

std::vector<std::uint32_t> all_nodes(const Body& body) {
  return nodes_where(body.mesh(), [](const Vector3d&) { return true; });
}

TEST(ElasticContact, PointsStandForTheWholeAreaAndInterpolateLinearFunctions) {
  for (const bool is_quadratic : {false, true}) {
    const Mesh linear = beam_mesh(4, 2);
    const Mesh mesh = is_quadratic ? quadratic(linear) : linear;
    double area = 0.0;
    const VectorXd x = Body({.mesh = mesh, .fixed_nodes = {0}}).rest_m();
    for (const SurfacePoint& point : surface_points(mesh, surface_of(mesh), 3)) {
      area += point.area_m2;
      double sum = 0.0;
      for (const double weight : point.weights) sum += weight;
      EXPECT_NEAR(sum, 1.0, 1e-14);
      const Vector3d at = point.position_m(x.data());
      EXPECT_GE(at.minCoeff(), -1e-15);
    }
    EXPECT_NEAR(area, 4 * 0.1 * 0.025 + 2 * 0.025 * 0.025, 1e-12);
  }
}

// Hertz, F = 4/3 E/(1 − ν²) √R d^1.5, holds for d ≪ R in a large block: 37.4 mN at 1 mm.
TEST(ElasticContact, ASmallIndentationFollowsHertzAndThePointsOnlyPress) {
  const Body body(
      bench::standing_block(quadratic(block_mesh(4, 5, 1.6e-3)), Law::kStableNeoHookean));
  SphereContact contact(bench::top_points(body.mesh(), 0.006, 4), 4e7);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  contact.set_sphere(sphere_at(1e-3), kRadius);
  double deepest_m = 0.0;
  for (int round = 0; round < 4; ++round) {
    ASSERT_TRUE(find_rest(search, factor, &contact, {.tolerance_m = 1e-7}, x).is_converged);
    deepest_m = contact.update_multipliers(x.data(), body.pattern());
  }
  const double hertz =
      4.0 / 3.0 * 10e3 / (1 - 0.45 * 0.45) * std::sqrt(kRadius) * std::pow(1e-3, 1.5);
  const Vector3d force = contact.force_on_sphere_newton();
  EXPECT_NEAR(force.z(), hertz, 0.06 * hertz);
  EXPECT_LT(std::hypot(force.x(), force.y()), 0.01 * hertz);
  EXPECT_LT(deepest_m, 3e-5);

  // away from the body it is felt no more: nothing pulls
  contact.set_sphere(sphere_at(-1e-3), kRadius);
  for (int round = 0; round < 2; ++round) {
    static_cast<void>(find_rest(search, factor, &contact, {.tolerance_m = 1e-7}, x));
    contact.update_multipliers(x.data(), body.pattern());
  }
  EXPECT_EQ(contact.force_on_sphere_newton().norm(), 0.0);
  EXPECT_LT((x - body.rest_m()).cwiseAbs().maxCoeff(), 1e-6);
}

class Condensed : public testing::Test {
 protected:
  Body body_{bench::standing_block(block_mesh(4, 5, 1.25e-3), Law::kCorotational)};
  std::vector<SurfacePoint> points_ = bench::top_points(body_.mesh(), 0.004, 2);
  WarpedFactor factor_{body_, Precision::kFloat};

  void SetUp() override {
    ASSERT_TRUE(factor_.factor(body_.rest_m(), no_rotations(body_.node_count()), {}, nullptr));
  }
};

// What was forgotten is made again, the same to the bit.
TEST_F(Condensed, ColumnsTakeNoMoreMemoryThanTheyMay) {
  const std::size_t one = 9 * body_.node_count();
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_), 4 * one);
  const std::uint32_t first = points_.front().nodes[0];
  const auto required = compliance.require({{first}});
  const std::vector<float> before(required.of(first), required.of(first) + one);
  std::set<std::uint32_t> others;
  for (const SurfacePoint& point : points_)
    others.insert(point.nodes.begin(), point.nodes.begin() + 3);
  others.erase(first);
  ASSERT_GT(others.size(), 8U);
  for (const std::uint32_t node : others) {
    compliance.require({{node}});
    ASSERT_LE(compliance.all_columns().size(), 4U);
    ASSERT_TRUE(compliance.all_columns().contains(node));
  }
  EXPECT_FALSE(compliance.all_columns().contains(first));
  const auto again = compliance.require({{first}});
  EXPECT_NE(again.of(first), required.of(first));
  EXPECT_TRUE(std::equal(before.begin(), before.end(), again.of(first)));
  // what is in use stays as it is
  EXPECT_TRUE(std::equal(before.begin(), before.end(), required.of(first)));
  // all that one call requires stays
  const std::vector<std::uint32_t> all(others.begin(), others.end());
  compliance.require(all);
  EXPECT_EQ(compliance.all_columns().size(), all.size());
  const auto last = compliance.require({{first}});
  EXPECT_EQ(compliance.all_columns().size(), 4U);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), last.of(first)));
}

// A column is the solution for a unit force at a node, however many are solved together.
TEST_F(Condensed, ColumnsAreSolutionsForUnitForces) {
  for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
    WarpedFactor factor(body_, precision);
    SurfaceCompliance compliance(body_, factor, all_nodes(body_));
    std::vector<std::uint32_t> nodes(2 * WarpedFactor::kMostColumns + 3);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      nodes[i] = static_cast<std::uint32_t>(i * (body_.node_count() - 1) / (nodes.size() - 1));
    }
    const auto columns = compliance.require(nodes);
    VectorXd force = VectorXd::Zero(body_.rest_m().size());
    VectorXd moved_m = force;
    std::size_t fixed = 0;
    for (const std::uint32_t node : nodes) {
      fixed += body_.pattern().row_of[node] < 0 ? 1U : 0U;
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        force.setZero();
        force[3 * Eigen::Index{node} + axis] = 1.0;
        factor.solve(force.data(), moved_m.data());
        if (body_.pattern().row_of[node] < 0) moved_m.setZero();
        for (Eigen::Index k = 0; k < moved_m.size(); ++k) {
          const double column = static_cast<double>(columns.of(node)[3 * k + axis]);
          ASSERT_NEAR(column, moved_m[k], 1e-5 * moved_m.cwiseAbs().maxCoeff()) << node;
        }
      }
    }
    EXPECT_GT(fixed, 0U);
    EXPECT_LT(fixed, nodes.size() - WarpedFactor::kMostColumns);
  }
}

TEST_F(Condensed, GivesTheForceOfTheFullSolution) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.0, CondensedContact::kStiffness_pa_per_m, true);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
  ASSERT_EQ(condensed.point_count(), 30);
  std::vector<SurfacePoint> same;
  for (const std::size_t i : condensed.chosen()) same.push_back(points_[i]);
  SphereContact contact(same, 4e7);
  EquilibriumSearch search(body_);
  WarpedFactor full(body_, Precision::kDouble);
  VectorXd x = body_.rest_m();
  // a linear model: its error grows with the depth
  for (const auto& [depth_m, error_ratio] : {std::pair{0.2e-3, 0.03}, {0.5e-3, 0.08}}) {
    contact.set_sphere(sphere_at(depth_m), kRadius);
    for (int round = 0; round < 6; ++round) {
      ASSERT_TRUE(find_rest(search, full, &contact, {.tolerance_m = 1e-8}, x).is_converged);
      contact.update_multipliers(x.data(), body_.pattern());
    }
    const CondensedReport report = condensed.step(sphere_at(depth_m), kRadius, 500, 1e-10);
    const double newton = contact.force_on_sphere_newton().z();
    EXPECT_NEAR(report.force_on_sphere_newton.z(), newton, error_ratio * newton) << depth_m;
    EXPECT_GT(report.touching, 3);
    EXPECT_LT(report.deepest_m, 1e-7);
  }
  // the surface went where the full solution says, within the error of the linear model
  std::vector<float> moved(condensed.surface_size());
  condensed.move_surface(moved.data());
  double largest_m = 0.0;
  double error_m = 0.0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double way = x[i] - body_.rest_m()[i];
    largest_m = std::max(largest_m, std::abs(way));
    error_m =
        std::max(error_m, std::abs(way - static_cast<double>(moved[static_cast<std::size_t>(i)])));
  }
  EXPECT_LT(error_m, 0.1 * largest_m);
}

TEST_F(Condensed, CondensesOnlyWhatIsTouchedAndOnlyOnce) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.0);
  EXPECT_EQ(compliance.columns_made(), 0U);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 10);
  const std::size_t made = compliance.columns_made();
  EXPECT_GT(made, 0U);
  EXPECT_LT(made, 20U);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 10);
  EXPECT_EQ(compliance.columns_made(), made);
}

TEST_F(Condensed, FrictionStaysWithinTheConeAndHoldsWithoutSliding) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  const auto drag_newton = [&](double friction, double way_m) {
    CondensedContact condensed(compliance, friction);
    condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
    Vector3d centre = sphere_at(0.4e-3);
    condensed.step(centre, kRadius, 500, 1e-10);
    CondensedReport report;
    for (int i = 0; i < 20; ++i) {
      centre.x() += way_m / 20;
      report = condensed.step(centre, kRadius, 500, 1e-10);
    }
    return report.force_on_sphere_newton;
  };
  const Vector3d without = drag_newton(0.0, 0.2e-3);
  const Vector3d slight = drag_newton(0.2, 0.2e-3);
  const Vector3d strong = drag_newton(5.0, 0.02e-3);
  EXPECT_LT(slight.x(), without.x() - 0.05 * slight.z());  // resists the motion along +x
  // each point is within its cone, so the sum is within µ times the sum of normal forces
  EXPECT_LT(std::abs(slight.x() - without.x()), 0.25 * slight.z());
  EXPECT_LT(strong.x(), 0.0);
}

TEST_F(Condensed, AStepDoesNotAllocateAndNothingTouchedGivesNoForce) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.3, CondensedContact::kStiffness_pa_per_m, true);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
  std::vector<float> moved(condensed.surface_size());
  const test::AllocGuard guard;
  for (int i = 0; i < 50; ++i) {
    condensed.step(sphere_at(1e-5 * i), kRadius, 10, 1e-9);
    condensed.move_surface(moved.data());
  }
  const CondensedReport away = condensed.step(sphere_at(-5e-3), kRadius, 100, 1e-9);
  EXPECT_EQ(guard.count(), 0U);
  EXPECT_EQ(away.touching, 0);
  EXPECT_EQ(away.force_on_sphere_newton.norm(), 0.0);
}

class ComplianceFile : public testing::Test {
 protected:
  Body body_{bench::standing_block(block_mesh(4, 5, 1.25e-3), Law::kStableNeoHookean)};
  WarpedFactor factor_{body_, Precision::kFloat};
  SurfaceCompliance compliance_{body_, factor_, all_nodes(body_)};
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("palpate_compliance_" + std::to_string(::getpid()));
  std::filesystem::path file_;

  void SetUp() override {
    std::filesystem::create_directories(folder_);
    file_ = compliance_file(folder_, compliance_);
    compliance_.require({{100U, 200U, 300U}});
    save_columns(compliance_, file_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void change_byte(std::streamoff at) const {
    std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(at);
    const int byte = file.get();
    file.seekp(at);
    file.put(static_cast<char>(byte ^ 1));
  }
};

TEST_F(ComplianceFile, GivesTheSameColumns) {
  WarpedFactor factor(body_, Precision::kFloat);
  SurfaceCompliance other(body_, factor, all_nodes(body_));
  ASSERT_EQ(load_columns(file_, other), "");
  ASSERT_EQ(other.all_columns().size(), compliance_.all_columns().size());
  for (const auto& [node, values] : compliance_.all_columns()) {
    EXPECT_EQ(*other.all_columns().at(node), *values) << node;
  }
  other.require({{200U}});
  EXPECT_EQ(other.columns_made(), 0U);
  // nothing but the file is left behind
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
  // one that is missing is made
  other.require({{201U}});
  EXPECT_EQ(other.columns_made(), 1U);
}

// Its hash is right: somebody who may write the file has written it.
TEST_F(ComplianceFile, WithOtherColumnsIsRefused) {
  SurfaceCompliance::Columns columns = compliance_.all_columns();
  for (auto& [node, values] : columns) {
    std::vector<float> others = *values;
    for (float& value : others) value *= 1.5F;
    values = std::make_shared<const std::vector<float>>(std::move(others));
  }
  SurfaceCompliance forged(body_, factor_, all_nodes(body_));
  forged.set_columns(columns);
  save_columns(forged, file_);
  SurfaceCompliance other(body_, factor_, all_nodes(body_));
  EXPECT_NE(load_columns(file_, other).find("not those of this body"), std::string::npos);
  EXPECT_TRUE(other.all_columns().empty());
}

TEST_F(ComplianceFile, AnotherBodyHasAnotherFile) {
  BodyDescription stiffer = body_.description();
  stiffer.materials[0].young_modulus_pa *= 1.001;
  const Body body(stiffer);
  WarpedFactor factor(body, Precision::kFloat);
  SurfaceCompliance other(body, factor, all_nodes(body));
  EXPECT_NE(compliance_file(folder_, other), file_);
  EXPECT_NE(load_columns(file_, other).find("another body"), std::string::npos);
  EXPECT_TRUE(other.all_columns().empty());
}

TEST_F(ComplianceFile, DamagedFilesAreRefusedAndWhatIsThereIsKept) {
  const auto refused = [&](const char* reason) {
    SurfaceCompliance other(body_, factor_, all_nodes(body_));
    other.require({{7U}});
    EXPECT_NE(load_columns(file_, other).find(reason), std::string::npos) << reason;
    EXPECT_EQ(other.all_columns().size(), 1U);
  };
  change_byte(0);
  refused("not a compliance");
  change_byte(0);
  change_byte(8);
  refused("version");
  change_byte(8);
  change_byte(200);
  refused("damaged");
  change_byte(200);
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) - 1);
  refused("cut short");
  std::filesystem::resize_file(file_, 10);
  refused("cut short");
  std::filesystem::remove(file_);
  refused("no such file");
}

// A link that another user prepared leads nowhere, and a pipe does not make the program wait.
TEST_F(ComplianceFile, FollowsNoLinkAndWaitsForNoPipe) {
  const std::filesystem::path victim = folder_ / "victim";
  std::ofstream(victim) << "precious";
  const auto victim_text = [&] {
    std::ifstream in(victim);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const std::filesystem::path part = file_.string() + "." + std::to_string(::getpid()) + ".part";
  std::filesystem::create_symlink(victim, part);
  save_columns(compliance_, file_);
  EXPECT_EQ(victim_text(), "precious");
  EXPECT_FALSE(std::filesystem::is_symlink(file_));

  SurfaceCompliance other(body_, factor_, all_nodes(body_));
  std::filesystem::rename(file_, victim);
  std::filesystem::create_symlink(victim, file_);
  EXPECT_NE(load_columns(file_, other).find("link"), std::string::npos);
  std::filesystem::remove(file_);
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_NE(load_columns(file_, other), "");
  std::filesystem::remove(file_);
  std::filesystem::rename(victim, file_);
  std::filesystem::permissions(file_, std::filesystem::perms::group_write,
                               std::filesystem::perm_options::add);
  EXPECT_NE(load_columns(file_, other).find("another user"), std::string::npos);
  std::filesystem::permissions(file_, std::filesystem::perms::owner_all);
  EXPECT_EQ(load_columns(file_, other), "");
}

TEST_F(ComplianceFile, AFolderThatCannotBeWrittenIsAnErrorWithItsName) {
  try {
    save_columns(compliance_, folder_ / "absent" / "x");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("absent"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate::elastic
