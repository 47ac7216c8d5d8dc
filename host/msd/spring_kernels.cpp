#include "host/msd/spring_kernels.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host/msd/spring.hpp"

namespace palpate::host {
namespace {

// Springs handled at a time: their forces stay in the first-level cache between the two passes that add them
// to either end. (The passes are apart because i and i + offset overlap, which would keep the compiler from
// vectorizing.)
constexpr std::ptrdiff_t kChunk = 256;
constexpr double kSmallestSquaredLength_m2 = kSmallestSpringLength_m * kSmallestSpringLength_m;

using Chunk = std::array<double, static_cast<std::size_t>(kChunk)>;

// Adds the forces of `count` springs to their ends.
[[gnu::always_inline]] inline void scatter(const double* __restrict force, std::ptrdiff_t count,
                                           std::ptrdiff_t offset, double* node) {
  for (std::ptrdiff_t s = 0; s < count; ++s) node[s] += force[s];
  double* other_end = node + offset;
  for (std::ptrdiff_t s = 0; s < count; ++s) other_end[s] -= force[s];
}

[[gnu::always_inline]] inline void add_forces(const BandView& band, const NodalView& position_m,
                                              const NodalView& velocity_m_s,
                                              const MutableNodalView& force_N) {
  alignas(64) Chunk force_x;
  alignas(64) Chunk force_y;
  alignas(64) Chunk force_z;
  const double stiffness = band.stiffness_N_m;
  const double damping = band.damping_N_s_m;
  const double prestress = band.stiffness_N_m * band.rest_length_m;
  for (std::ptrdiff_t begin = 0; begin < band.count; begin += kChunk) {
    const std::ptrdiff_t count = std::min(kChunk, band.count - begin);
    const std::ptrdiff_t i = band.first + begin;
    const std::ptrdiff_t j = i + band.offset;
    const double* __restrict present = band.present + begin;
    const double* xi = position_m.x + i;
    const double* yi = position_m.y + i;
    const double* zi = position_m.z + i;
    const double* xj = position_m.x + j;
    const double* yj = position_m.y + j;
    const double* zj = position_m.z + j;
    const double* ui = velocity_m_s.x + i;
    const double* vi = velocity_m_s.y + i;
    const double* wi = velocity_m_s.z + i;
    const double* uj = velocity_m_s.x + j;
    const double* vj = velocity_m_s.y + j;
    const double* wj = velocity_m_s.z + j;
    double* __restrict fx = force_x.data();
    double* __restrict fy = force_y.data();
    double* __restrict fz = force_z.data();
    for (std::ptrdiff_t s = 0; s < count; ++s) {
      const double dx = xj[s] - xi[s];
      const double dy = yj[s] - yi[s];
      const double dz = zj[s] - zi[s];
      const double squared = dx * dx + dy * dy + dz * dz;
      // The tiny addend changes no bit of any real length; for coincident nodes it keeps the inverse finite,
      // which then meets a separation of zero. (A comparison here would keep GCC from vectorizing.)
      const double inverse = 1.0 / std::sqrt(squared + kSmallestSquaredLength_m2);
      const double closing = (uj[s] - ui[s]) * dx + (vj[s] - vi[s]) * dy + (wj[s] - wi[s]) * dz;
      // tension / length = k (1 - rest / length) + b (u . d) / length^2
      const double pull =
          (stiffness - prestress * inverse + damping * closing * (inverse * inverse)) * present[s];
      fx[s] = pull * dx;
      fy[s] = pull * dy;
      fz[s] = pull * dz;
    }
    scatter(fx, count, band.offset, force_N.x + i);
    scatter(fy, count, band.offset, force_N.y + i);
    scatter(fz, count, band.offset, force_N.z + i);
  }
}

[[gnu::always_inline]] inline void linearize(const BandView& band, const LinearWeights& weights,
                                             const NodalView& position_m, const NodalView& velocity_m_s,
                                             const LinearBandView& linear) {
  // Local arrays, because GCC gives up on proving that more than a few pointers do not overlap.
  alignas(64) Chunk direction_x;
  alignas(64) Chunk direction_y;
  alignas(64) Chunk direction_z;
  alignas(64) Chunk transverse;
  const double stiffness = weights.stiffness * band.stiffness_N_m;
  const double prestress = stiffness * band.rest_length_m;
  const double damping = weights.stiffness * band.damping_N_s_m;
  const double left_out = weights.only_stretched ? 1.0 : 0.0;  // part of a negative tension
  for (std::ptrdiff_t begin = 0; begin < band.count; begin += kChunk) {
    const std::ptrdiff_t count = std::min(kChunk, band.count - begin);
    const std::ptrdiff_t i = band.first + begin;
    const std::ptrdiff_t j = i + band.offset;
    const double* present = band.present + begin;
    const double* xi = position_m.x + i;
    const double* yi = position_m.y + i;
    const double* zi = position_m.z + i;
    const double* xj = position_m.x + j;
    const double* yj = position_m.y + j;
    const double* zj = position_m.z + j;
    const double* ui = velocity_m_s.x + i;
    const double* vi = velocity_m_s.y + i;
    const double* wi = velocity_m_s.z + i;
    const double* uj = velocity_m_s.x + j;
    const double* vj = velocity_m_s.y + j;
    const double* wj = velocity_m_s.z + j;
    double* __restrict nx = direction_x.data();
    double* __restrict ny = direction_y.data();
    double* __restrict nz = direction_z.data();
    double* __restrict nt = transverse.data();
    for (std::ptrdiff_t s = 0; s < count; ++s) {
      const double dx = xj[s] - xi[s];
      const double dy = yj[s] - yi[s];
      const double dz = zj[s] - zi[s];
      const double squared = dx * dx + dy * dy + dz * dz;
      const double inverse = 1.0 / std::sqrt(squared + kSmallestSquaredLength_m2);
      const double closing = (uj[s] - ui[s]) * dx + (vj[s] - vi[s]) * dy + (wj[s] - wi[s]) * dz;
      const double scale = present[s] * (squared * inverse * inverse);  // 1, but 0 where absent or coincident
      const double tension = stiffness - prestress * inverse + damping * closing * (inverse * inverse);
      const double negative = 0.5 * (tension - std::fabs(tension));
      nx[s] = scale * inverse * dx;
      ny[s] = scale * inverse * dy;
      nz[s] = scale * inverse * dz;
      nt[s] = scale * (tension - left_out * negative);
    }
    std::copy_n(nx, count, linear.direction_x + begin);
    std::copy_n(ny, count, linear.direction_y + begin);
    std::copy_n(nz, count, linear.direction_z + begin);
    std::copy_n(nt, count, linear.transverse + begin);
  }
}

[[gnu::always_inline]] inline void apply(const LinearBandView& linear, const NodalView& operand,
                                         const MutableNodalView& product) {
  alignas(64) Chunk force_x;
  alignas(64) Chunk force_y;
  alignas(64) Chunk force_z;
  const double axial = linear.axial;
  for (std::ptrdiff_t begin = 0; begin < linear.count; begin += kChunk) {
    const std::ptrdiff_t count = std::min(kChunk, linear.count - begin);
    const std::ptrdiff_t i = linear.first + begin;
    const std::ptrdiff_t j = i + linear.offset;
    const double* nx = linear.direction_x + begin;
    const double* ny = linear.direction_y + begin;
    const double* nz = linear.direction_z + begin;
    const double* transverse = linear.transverse + begin;
    const double* xi = operand.x + i;
    const double* yi = operand.y + i;
    const double* zi = operand.z + i;
    const double* xj = operand.x + j;
    const double* yj = operand.y + j;
    const double* zj = operand.z + j;
    double* __restrict fx = force_x.data();
    double* __restrict fy = force_y.data();
    double* __restrict fz = force_z.data();
    for (std::ptrdiff_t s = 0; s < count; ++s) {
      const double dx = xi[s] - xj[s];
      const double dy = yi[s] - yj[s];
      const double dz = zi[s] - zj[s];
      const double along = (axial - transverse[s]) * (nx[s] * dx + ny[s] * dy + nz[s] * dz);
      fx[s] = transverse[s] * dx + along * nx[s];
      fy[s] = transverse[s] * dy + along * ny[s];
      fz[s] = transverse[s] * dz + along * nz[s];
    }
    scatter(fx, count, linear.offset, product.x + i);
    scatter(fy, count, linear.offset, product.y + i);
    scatter(fz, count, linear.offset, product.z + i);
  }
}

// The same source compiled for wider registers, chosen when the program runs. Not by target_clones: its
// resolvers run before a sanitizer's run-time library is ready.
#if defined(__x86_64__)
#define PALPATE_WIDE [[gnu::target("avx2")]]
bool has_wide_registers() {
  static const bool present = __builtin_cpu_supports("avx2") != 0;
  return present;
}
#else
#define PALPATE_WIDE
bool has_wide_registers() {
  return false;
}
#endif

PALPATE_WIDE void add_forces_wide(const BandView& band, const NodalView& position_m,
                                  const NodalView& velocity_m_s, const MutableNodalView& force_N) {
  add_forces(band, position_m, velocity_m_s, force_N);
}

PALPATE_WIDE void linearize_wide(const BandView& band, const LinearWeights& weights,
                                 const NodalView& position_m, const NodalView& velocity_m_s,
                                 const LinearBandView& linear) {
  linearize(band, weights, position_m, velocity_m_s, linear);
}

PALPATE_WIDE void apply_wide(const LinearBandView& linear, const NodalView& operand,
                             const MutableNodalView& product) {
  apply(linear, operand, product);
}

}  // namespace

void add_band_forces(const BandView& band, const NodalView& position_m, const NodalView& velocity_m_s,
                     const MutableNodalView& force_N) {
  if (has_wide_registers()) return add_forces_wide(band, position_m, velocity_m_s, force_N);
  add_forces(band, position_m, velocity_m_s, force_N);
}

void linearize_band(const BandView& band, const LinearWeights& weights, const NodalView& position_m,
                    const NodalView& velocity_m_s, const LinearBandView& linear) {
  if (has_wide_registers()) return linearize_wide(band, weights, position_m, velocity_m_s, linear);
  linearize(band, weights, position_m, velocity_m_s, linear);
}

void apply_band(const LinearBandView& linear, const NodalView& operand, const MutableNodalView& product) {
  if (has_wide_registers()) return apply_wide(linear, operand, product);
  apply(linear, operand, product);
}

}  // namespace palpate::host
