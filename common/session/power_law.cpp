// SPDX-License-Identifier: Apache-2.0
#include "common/session/power_law.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate {
namespace {

constexpr int kBranches = 7;
constexpr int kFrequencies = 81;
// The corner frequencies of the branches reach beyond the range by this factor on each side.
constexpr double kBeyond = 6.0;

/// i ω τ / (1 + i ω τ)
std::complex<double> branch_modulus(double frequency_hz, double tau_s) {
  const std::complex<double> turned(0.0, 2.0 * std::numbers::pi * frequency_hz * tau_s);
  return turned / (1.0 + turned);
}

double spaced(double from, double to, int i, int count) {
  return from * std::pow(to / from, static_cast<double>(i) / (count - 1));
}

}  // namespace

PowerLawFit fit_power_law(double exponent, double at_hz) {
  std::vector<double> taus;
  for (int i = 0; i < kBranches; ++i) {
    taus.push_back(
        1.0 / (2.0 * std::numbers::pi *
               spaced(kPowerLawLeast_hz / kBeyond, kPowerLawLargest_hz * kBeyond, i, kBranches)));
  }
  // rows: real and imaginary part at each frequency, relative; columns: rest, branches
  Eigen::MatrixXd parts(2 * kFrequencies, kBranches + 1);
  Eigen::VectorXd wanted(2 * kFrequencies);
  for (int row = 0; row < kFrequencies; ++row) {
    const double f = spaced(kPowerLawLeast_hz, kPowerLawLargest_hz, row, kFrequencies);
    const std::complex<double> law = std::pow(std::complex<double>(0.0, f / at_hz), exponent);
    const double size = std::abs(law);
    wanted[2 * row] = law.real() / size;
    wanted[2 * row + 1] = law.imag() / size;
    parts(2 * row, 0) = 1.0 / size;
    parts(2 * row + 1, 0) = 0.0;
    for (int i = 0; i < kBranches; ++i) {
      const std::complex<double> one = branch_modulus(f, taus[static_cast<std::size_t>(i)]);
      parts(2 * row, i + 1) = one.real() / size;
      parts(2 * row + 1, i + 1) = one.imag() / size;
    }
  }
  // least squares; columns that would be negative leave, the worst first
  std::vector<int> used(kBranches + 1);
  for (int i = 0; i <= kBranches; ++i) used[static_cast<std::size_t>(i)] = i;
  Eigen::VectorXd found;
  while (true) {
    Eigen::MatrixXd chosen(parts.rows(), static_cast<Eigen::Index>(used.size()));
    for (std::size_t i = 0; i < used.size(); ++i) {
      chosen.col(static_cast<Eigen::Index>(i)) = parts.col(used[i]);
    }
    found = chosen.colPivHouseholderQr().solve(wanted);
    Eigen::Index worst = 0;
    if (found.minCoeff(&worst) > 0.0 || used.size() == 1) break;
    used.erase(used.begin() + worst);
  }
  PowerLawFit fit;
  const double all = found.sum();
  fit.rest_ratio = used.front() == 0 ? found[0] : 0.0;
  for (std::size_t i = used.front() == 0 ? 1 : 0; i < used.size(); ++i) {
    fit.branches.push_back({.share = found[static_cast<Eigen::Index>(i)] / all,
                            .tau_s = taus[static_cast<std::size_t>(used[i] - 1)]});
  }
  for (int i = 0; i < kFrequencies; ++i) {
    const double f = spaced(kPowerLawLeast_hz, kPowerLawLargest_hz, i, kFrequencies);
    const std::complex<double> law = std::pow(std::complex<double>(0.0, f / at_hz), exponent);
    const std::complex<double> fitted = fit.rest_ratio * modulus_ratio(fit.branches, f);
    fit.error_ratio = std::max(fit.error_ratio, std::abs(fitted - law) / std::abs(law));
  }
  return fit;
}

std::complex<double> modulus_ratio(const std::vector<ElasticMaterial::Branch>& branches,
                                   double frequency_hz) {
  double shares = 0.0;
  for (const ElasticMaterial::Branch& branch : branches) shares += branch.share;
  std::complex<double> sum = 1.0;
  for (const ElasticMaterial::Branch& branch : branches) {
    sum += branch.share / (1.0 - shares) * branch_modulus(frequency_hz, branch.tau_s);
  }
  return sum;
}

}  // namespace palpate
