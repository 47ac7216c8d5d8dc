// One fixed run of everything in shared/ whose bits must be equal on every machine: local model, contact,
// kinematics, statics, encoders, the tip between their counts, sine and cosine. Its hashes are compared
// between x86-64 (-O0 and -O2) and the microcontroller (hil_tests/test_golden.py).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/contact/contact_state.hpp"
#include "shared/math/linear.hpp"
#include "shared/model/local_model.hpp"
#include "shared/model/modal_surface.hpp"

namespace palpate::golden {

// FNV-1a, 64 bits, over the bits of what it is given, least significant byte first.
class Fnv1a {
 public:
  void add(std::uint32_t word);
  // Every NaN counts as the same number: IEEE 754 leaves its bits open.
  void add(float value);
  void add(const Vec3f& vector);
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 14695981039346656037ull;
};

// What the run went through, so that a test can tell that it was not vacuous.
struct Counters {
  std::uint32_t free_ticks = 0, stick_ticks = 0, slip_ticks = 0;
  std::uint32_t touches = 0;      // free to contact
  std::uint32_t separations = 0;  // contact to free
  std::uint32_t stick_to_slip = 0, slip_to_stick = 0;
  std::uint32_t edge_crossings = 0;    // slip onto another triangle
  std::uint32_t border_ticks = 0;      // contact held at the border of the patch
  std::uint32_t inset_ticks = 0;       // something left of a start inside
  std::uint32_t stretched_ticks = 0;   // of the coupling
  std::uint32_t limited_currents = 0;  // set-points scaled to the peak current
  std::uint32_t pose_faults = 0;       // poses outside the workspace
  float largest_force_N = 0.0f;
};

struct Result {
  std::uint64_t model_hash = 0;   // model and contact
  std::uint64_t near_hash = 0;    // model and contact with springs near the contact
  std::uint64_t felt_hash = 0;    // the same as an arm feels it: estimated tip, couplings, flat triangles
  std::uint64_t device_hash = 0;  // kinematics, statics, encoders
  std::uint64_t math_hash = 0;    // sine and cosine
  std::uint32_t work = 0;         // of the first three (ModalSurface::work): what the board plans with
  Counters counters{};            // of the model
  Counters near{};
  Counters felt{};
  float farthest_estimate_m = 0.0f;  // of the tip from that of the counts
};

// A patch of 4x4 masses with a mode for each of their 48 degrees of freedom. Too large for a
// microcontroller's stack.
class GoldenTrace {
 public:
  // Any context; equal results at each call.
  Result run();

 private:
  static constexpr std::size_t kSide = 4;
  static constexpr std::size_t kNodes = kSide * kSide;
  static constexpr std::size_t kTriangles = 2 * (kSide - 1) * (kSide - 1);
  static constexpr std::size_t kModes = 3 * kNodes;

  void build_model();
  void connect_neighbours();
  void run_model(Result& result);
  void run_near(Result& result);
  // Model and contact through all movements.
  std::uint64_t run_movements(Counters& counters);
  void run_felt(Result& result);

  std::array<float, 3 * kNodes> position_m_{};
  std::array<std::uint8_t, 3 * kTriangles> corner_{};
  std::array<std::uint16_t, kTriangles> triangle_id_{};
  Friction<float> friction_{};  // of all triangles, as the movement has it
  std::array<std::uint8_t, kTriangles> triangle_friction_{};
  std::array<float, kCoefficientsPerMode * kModes> coefficient_{};
  std::array<float, kModes> load_{};
  std::array<float, kModes> basis_scale_{};
  std::array<std::int16_t, 3 * kNodes * kModes> basis_{};
  static constexpr std::size_t kSprings = 2 * kSide * (kSide - 1) + 2 * (kSide - 1) * (kSide - 1);
  std::array<float, 3 * kNodes> rest_m_{};
  std::array<std::uint8_t, 2 * kSprings> spring_end_{};
  std::array<std::uint8_t, kSprings> spring_kind_{};
  LocalModelView view_{};
  ModalState state_{};
  ModalSurface surface_{};
};

}  // namespace palpate::golden
