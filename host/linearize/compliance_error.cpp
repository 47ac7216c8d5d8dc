#include "host/linearize/compliance_error.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>
#include <string>

namespace palpate::host {
namespace {

constexpr double kLowest_Hz = 0.1, kHighest_Hz = 500.0;

}  // namespace

std::vector<double> compliance_grid_Hz(int per_decade) {
  const double decades = std::log10(kHighest_Hz / kLowest_Hz);
  const int steps = static_cast<int>(std::ceil(per_decade * decades));
  std::vector<double> grid_Hz{0.0};
  for (int i = 0; i <= steps; ++i) grid_Hz.push_back(kLowest_Hz * std::pow(10.0, decades * i / steps));
  return grid_Hz;
}

double norm(const Eigen::Matrix3cd& compliance) {
  return Eigen::JacobiSVD<Eigen::Matrix3cd>(compliance).singularValues()[0];
}

Eigen::Matrix3Xd modes_at(const LocalModel& model, const SurfacePoint& point) {
  const auto found = std::find(model.triangle.begin(), model.triangle.end(), point.triangle);
  if (found == model.triangle.end())
    throw std::invalid_argument("triangle " + std::to_string(point.triangle) +
                                " does not belong to the local model");
  const auto& corner = model.corner[static_cast<std::size_t>(found - model.triangle.begin())];
  Eigen::Matrix3Xd phi = Eigen::Matrix3Xd::Zero(3, model.modes());
  for (int c = 0; c < 3; ++c)
    phi += point.barycentric[c] * model.basis.middleRows<3>(3 * corner[static_cast<std::size_t>(c)]);
  return phi;
}

Eigen::Matrix3cd compliance(const LocalModel& model, const SurfacePoint& point, double frequency_rad_s) {
  const Eigen::Matrix3Xd phi = modes_at(model, point);
  const double w = frequency_rad_s;
  const Eigen::VectorXcd answer =
      (model.lambda_rad2_s2.array() - w * w + std::complex<double>(0, w) * model.damping_rad_s.array())
          .inverse();
  return phi * answer.asDiagonal() * phi.transpose();
}

ComplianceError compliance_error(const LocalModel& model, const SurfacePoint& point,
                                 std::span<const double> frequency_Hz,
                                 std::span<const Eigen::Matrix3cd> body) {
  if (frequency_Hz.empty() || frequency_Hz.size() != body.size())
    throw std::invalid_argument("a compliance error needs the body's compliance at each of its frequencies");
  ComplianceError error;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double whole = norm(body[i]);
    if (!(whole > 0))
      throw std::invalid_argument("the body does not yield at the contact: it is fixed there");
    const double w = 2.0 * std::numbers::pi * frequency_Hz[i];
    error.relative.push_back(norm(compliance(model, point, w) - body[i]) / whole);
    if (error.relative.back() < error.largest) continue;
    error.largest = error.relative.back();
    error.largest_at_Hz = frequency_Hz[i];
  }
  return error;
}

}  // namespace palpate::host
