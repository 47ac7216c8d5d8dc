// The operators of section 4.2 of Jacobs, Fu, Cavusoglu 2010, built as matrices just as the paper writes
// them: Gram-Schmidt for the rows it leaves empty, explicit inverses. For checking;
// shared/contact/paper_contact.hpp applies the same operators in closed form, and lists our readings of the
// text.
#pragma once

#include <Eigen/Core>
#include <array>

namespace palpate::host::paper {

// The contact point (5): a triangle's nodes, and the barycentric coordinates (alpha, beta, gamma) on it.
struct ContactPoint {
  std::array<int, 3> corner{};
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
};

// Rows that complete `first_rows` (k x n, independent) to a regular n x n matrix: each of unit length and
// orthogonal to all others. Classical Gram-Schmidt, done twice, over the unit vectors; of these the one with
// the largest remainder is taken next. Throws std::invalid_argument for rows that are dependent.
Eigen::MatrixXd complete_by_gram_schmidt(const Eigen::MatrixXd& first_rows);

// T_11 (7), 9 x 9. Its first rows are as written, not of unit length: only then T x starts with p (9).
Eigen::MatrixXd barycentric_block(const Eigen::Vector3d& barycentric);

// T (8), 3m x 3m; the "without loss of generality" is a permutation that puts the triangle's nodes first.
Eigen::MatrixXd barycentric_transform(int nodes, const ContactPoint& point);

// U_0 (17), 3 x 3; normal: unit.
Eigen::Matrix3d normal_block(const Eigen::Vector3d& normal);

// U (18), (19), 3m x 3m.
Eigen::MatrixXd normal_transform(int nodes, const ContactPoint& point, const Eigen::Vector3d& normal);

// Projections of velocities, and of forces, for one transform and the number of leading coordinates that are
// constrained: (T, 3) gives P (10) and P~ (14); (U, 1) gives Q (20) and Q~ (22).
Eigen::MatrixXd velocity_projection(const Eigen::MatrixXd& transform, int constrained);
Eigen::MatrixXd force_projection(const Eigen::MatrixXd& transform, int constrained);

}  // namespace palpate::host::paper
