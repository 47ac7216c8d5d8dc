// A linear patch in the layout that the shared code reads.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/reference/linear_patch.hpp"
#include "shared/contact/linear_patch.hpp"

namespace palpate::host::paper {

// Owns what view() points to; not copied or moved, so that views stay valid.
template <class Real>
class PatchArrays {
 public:
  explicit PatchArrays(const LinearPatch& patch)
      : nodes_(static_cast<std::uint32_t>(patch.nodes())),
        rest_position_(cast(patch.rest_position_m)),
        rest_velocity_(cast(patch.rest_velocity_m_s)),
        rest_force_(cast(patch.rest_force_N)),
        df_dx_(cast(patch.df_dx_N_m)),
        df_dv_(cast(patch.df_dv_N_s_m)) {
    for (Eigen::Index n = 0; n < patch.nodes(); ++n) mass_.push_back(static_cast<Real>(patch.mass_kg[3 * n]));
    for (const auto& triangle : patch.corner)
      for (const int c : triangle) corner_.push_back(static_cast<std::uint32_t>(c));
  }
  PatchArrays(const PatchArrays&) = delete;
  PatchArrays& operator=(const PatchArrays&) = delete;

  [[nodiscard]] LinearPatchView<Real> view() const {
    return {nodes_,
            static_cast<std::uint32_t>(corner_.size() / 3),
            mass_.data(),
            rest_position_.data(),
            rest_velocity_.data(),
            rest_force_.data(),
            df_dx_.data(),
            df_dv_.data(),
            corner_.data()};
  }

 private:
  static std::vector<Real> cast(const Eigen::MatrixXd& values) {
    std::vector<Real> result;
    result.reserve(static_cast<std::size_t>(values.size()));
    for (Eigen::Index r = 0; r < values.rows(); ++r)
      for (Eigen::Index c = 0; c < values.cols(); ++c) result.push_back(static_cast<Real>(values(r, c)));
    return result;
  }

  std::uint32_t nodes_ = 0;
  std::vector<Real> mass_, rest_position_, rest_velocity_, rest_force_, df_dx_, df_dv_;
  std::vector<std::uint32_t> corner_;
};

}  // namespace palpate::host::paper
