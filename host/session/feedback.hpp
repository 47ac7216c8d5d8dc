// What the full body learns of the tip and of the local model between two updates, and what the board is sent
// for it (Jacobs, Fu, Cavusoglu 2010, section 3; docs/decisions/feedback.md).
#pragma once

#include <cstdint>
#include <memory>

#include "host/linearize/local_model.hpp"
#include "host/session/body_surface.hpp"
#include "host/session/tip_history.hpp"
#include "shared/model/local_model.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::host {

enum class Feedback {
  // The body goes through the measured tip path with the board's contact code.
  exact,
  // The paper's: the body moves without the tip; the nodes of the local model, which alone has the contact,
  // overwrite the body's at each update.
  paper,
  // What the paper argues against: the body knows the tip at the updates only, and what the local model has
  // done since is lost. The board begins each model as if it were of the present.
  discard,
  // The paper's global-only case: the body knows the tip at the updates only, and the board holds its force.
  hold,
};

class FeedbackScheme {
 public:
  FeedbackScheme() = default;
  FeedbackScheme(const FeedbackScheme&) = delete;
  FeedbackScheme& operator=(const FeedbackScheme&) = delete;
  virtual ~FeedbackScheme() = default;

  // Brings body and contact from the end of tick `from` to the end of tick `until`; path knows the tip in all
  // of them. Where a frame was lost the two may be equal: then nothing changes. Throws as BodySurface and
  // ModelReplay do.
  virtual void advance(BodySurface& surface, ContactState<double>& contact, const TipHistory& path,
                       std::uint32_t from, std::uint32_t until) = 0;
  // What the board is sent.
  [[nodiscard]] virtual ModelKind kind() const = 0;
  // The model that is sent after advance(), linearized at `state`, with the tip where it was then.
  virtual void sent(const LocalModel&, const wire::PackedModel&, const BodyState&, const Vec3d& /*tip_m*/) {}
  // Nothing was sent: there is no local model until the next one is.
  virtual void sent_none() {}
};

std::unique_ptr<FeedbackScheme> make_feedback(Feedback feedback, const ContactLaw<double>& law);

}  // namespace palpate::host
