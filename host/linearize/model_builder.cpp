#include "host/linearize/model_builder.hpp"

#include <stdexcept>

#include "host/linearize/hybrid_builder.hpp"
#include "host/linearize/krylov_builder.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/linearize/surrounded_patch_builder.hpp"

namespace palpate::host {
namespace {

class PatchBuilder final : public ModelBuilder {
 public:
  PatchBuilder(const Body& body, const PatchSize& patch, double step_s)
      : body_(body), patch_(patch), step_s_(step_s) {}
  LocalModel build(const BodyState& state, const SurfacePoint& contact,
                   const std::vector<int>& held) override {
    return build_patch(body_, state, contact, patch_, step_s_, {}, held);
  }

 private:
  const Body& body_;
  PatchSize patch_;
  double step_s_;
};

}  // namespace

std::unique_ptr<ModelBuilder> make_builder(const Body& body, const BuilderConfig& config, double step_s) {
  switch (config.builder) {
    case Builder::patch:
      return std::make_unique<PatchBuilder>(body, config.patch, step_s);
    case Builder::patch_rescaled:
      return std::make_unique<SurroundedPatchBuilder>(body, config.patch, SurroundedBy::rescaled, step_s);
    case Builder::condensed:
      return std::make_unique<SurroundedPatchBuilder>(body, config.patch, SurroundedBy::condensed, step_s);
    case Builder::krylov:
      return std::make_unique<KrylovBuilder>(body, config.patch, config.tangent,
                                             Shifts(config.shift_rad_s, config.middle_shift_rad_s), step_s,
                                             LocalModelCapacity{}, config.bases);
    case Builder::hybrid:
      return std::make_unique<HybridBuilder>(body, config.patch, config.near_nodes, config.middle_shift_rad_s,
                                             step_s, LocalModelCapacity{}, config.bases);
  }
  throw std::invalid_argument("builder: unknown");
}

}  // namespace palpate::host
