#include "host/reference/contact_runs.hpp"

#include <cmath>
#include <cstddef>
#include <memory>
#include <sstream>
#include <stdexcept>

#include "host/reference/modal_patch_surface.hpp"
#include "host/reference/patch_arrays.hpp"
#include "shared/contact/linear_patch.hpp"

namespace palpate::host::paper {
namespace {

[[noreturn]] void refuse(const char* name, double value, const char* allowed, double limit) {
  std::ostringstream message;
  message << name << " is " << value << ", allowed: " << allowed << limit;
  throw std::invalid_argument(message.str());
}

std::size_t ticks(const RunLength& length) {
  if (!(length.tick_s > 0)) refuse("tick_s", length.tick_s, "above ", 0);
  if (!(length.duration_s >= length.tick_s))
    refuse("duration_s", length.duration_s, "at least a tick, ", length.tick_s);
  return static_cast<std::size_t>(std::lround(length.duration_s / length.tick_s));
}

}  // namespace

std::vector<ForceSample> run_paper(const LinearPatch& patch, const PaperLaw<double>& law,
                                   const plant::TipPath& path, const RunLength& length, int substeps) {
  const std::size_t count = ticks(length);
  if (substeps < 1) refuse("substeps", substeps, "at least ", 1);
  if (patch.nodes() > static_cast<Eigen::Index>(kLargestPaperPatch))
    refuse("the number of nodes of the patch", static_cast<double>(patch.nodes()), "at most ",
           static_cast<double>(kLargestPaperPatch));
  const double step_s = length.tick_s / substeps, largest_s = largest_stable_step_s(patch);
  if (step_s > largest_s)
    refuse("the step of the paper's contact in s (tick / substeps)", step_s,
           "at most what explicit Euler (13) is stable with at this patch, ", largest_s);

  const PatchArrays<double> arrays(patch);
  // Some kilobytes: not for the stack.
  const auto shared = std::make_unique<palpate::LinearPatch<double, kLargestPaperPatch>>(arrays.view());
  PaperContactState<double> contact;
  std::vector<ForceSample> samples(count);
  Vec3d tip_m = path.at(0.0).position_m;
  for (std::size_t i = 0; i < count; ++i) {
    ForceSample& sample = samples[i];
    for (int k = 1; k <= substeps; ++k) {
      const double time_s = static_cast<double>(i) * length.tick_s + k * step_s;
      const Vec3d next_m = path.at(time_s).position_m;
      step_paper_contact(*shared, contact, law, tip_m, next_m, step_s);
      tip_m = next_m;
      sample.force_N += contact.instrument_force_N * (1.0 / substeps);
      sample.momentum_force_N += contact.momentum_force_N * (1.0 / substeps);
      sample.contact_steps += contact.mode != ContactMode::free;
    }
    sample.time_s = static_cast<double>(i + 1) * length.tick_s;
    sample.mode = contact.mode;
  }
  return samples;
}

std::vector<ForceSample> run_default(const LinearPatch& patch, const Friction<double>& friction,
                                     const plant::TipPath& path, const RunLength& length,
                                     SurfaceKind surface_kind) {
  const std::size_t count = ticks(length);
  ModalPatchSurface surface(patch, length.tick_s, surface_kind, friction);
  const ContactLaw<double> law{};
  ContactState<double> contact;
  std::vector<ForceSample> samples(count);
  Vec3d tip_m = path.at(0.0).position_m;
  for (std::size_t i = 0; i < count; ++i) {
    const double time_s = static_cast<double>(i + 1) * length.tick_s;
    const Vec3d next_m = path.at(time_s).position_m;
    step_contact(surface, contact, law, tip_m, next_m);
    tip_m = next_m;
    samples[i] = {time_s, contact.mode, contact.mode != ContactMode::free, -contact.force_N,
                  -contact.force_N};
  }
  return samples;
}

}  // namespace palpate::host::paper
