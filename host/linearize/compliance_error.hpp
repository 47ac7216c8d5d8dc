// How far a local model answers otherwise than the full linear body, at the contact and by frequency.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "host/linearize/local_model.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

// 0, then 40 frequencies in each decade from 0.1 to 500 Hz, both ends included. A grid four times as fine
// finds a largest error that is at most 2 % of itself larger (compliance_error_test.cpp).
std::vector<double> compliance_grid_Hz(int per_decade = 40);

// The modes at a point of the model's surface, 1 / sqrt(kg). Throws std::invalid_argument for a triangle that
// the model does not have.
Eigen::Matrix3Xd modes_at(const LocalModel& model, const SurfacePoint& point);

// Displacement of a point of the model's surface under unit forces on it, in continuous time, m / N: sum over
// modes of phi phi' / (lambda - w^2 + i w d). Throws std::invalid_argument for a triangle that the model does
// not have.
Eigen::Matrix3cd compliance(const LocalModel& model, const SurfacePoint& point, double frequency_rad_s);

// Largest singular value.
double norm(const Eigen::Matrix3cd& compliance);

// |model - body| / |body| at each frequency.
struct ComplianceError {
  std::vector<double> relative;
  double largest = 0;
  double largest_at_Hz = 0;
};
// body: the full body's compliance at each of frequency_Hz (body_response.hpp). Throws std::invalid_argument
// where sizes differ, none is given, or the body does not yield at all (a fixed node).
ComplianceError compliance_error(const LocalModel& model, const SurfacePoint& point,
                                 std::span<const double> frequency_Hz,
                                 std::span<const Eigen::Matrix3cd> body);

}  // namespace palpate::host
