// Runs of a scripted instrument over a linear patch: with the paper's contact, and with the default one.
#pragma once

#include <vector>

#include "host/plant/tip_path.hpp"
#include "host/reference/linear_patch.hpp"
#include "shared/contact/contact.hpp"
#include "shared/contact/paper_contact.hpp"
#include "shared/contact/surface_kind.hpp"

namespace palpate::host::paper {

// What the instrument feels in one tick; means over the tick's steps.
struct ForceSample {
  double time_s = 0;  // at the end of the tick
  ContactMode mode = ContactMode::free;
  int contact_steps = 0;     // of the tick's steps, those that ended in contact
  Vec3d force_N{};           // of the body on the instrument; with the paper's contact (15), (23) or (31)
  Vec3d momentum_force_N{};  // with what these equations leave out (PaperContactState); the default contact
                             // leaves nothing out
};

struct RunLength {
  double duration_s = 0;
  double tick_s = 1e-3;
};

// The paper's contact on the patch, starting at X0, V0; each tick in `substeps` equal steps, the instrument
// moving straight within each. Throws std::invalid_argument for a step above largest_stable_step_s, lengths
// that are not positive, or a patch of more than kLargestPaperPatch nodes.
inline constexpr std::size_t kLargestPaperPatch = 64;
std::vector<ForceSample> run_paper(const LinearPatch& patch, const PaperLaw<double>& law,
                                   const plant::TipPath& path, const RunLength& length, int substeps = 1);

// The default contact (shared/contact/contact.hpp) on the patch's exactly stepped modes, one step a tick; a
// point for a tip, coupled kinematically.
std::vector<ForceSample> run_default(const LinearPatch& patch, const Friction<double>& friction,
                                     const plant::TipPath& path, const RunLength& length,
                                     SurfaceKind surface = SurfaceKind::flat);

}  // namespace palpate::host::paper
