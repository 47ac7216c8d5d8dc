// A local model as it is packed for the wire (shared/wire/packed_model.hpp): single precision, basis
// quantized to 16 bits.
#pragma once

#include <cstdint>

#include "host/linearize/local_model.hpp"
#include "host/session/surface_friction.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/model_contents.hpp"

namespace palpate::host {

struct ModelStamp {
  std::uint32_t sequence = 0;
  std::uint32_t tick = 0;
  std::uint16_t valid_ticks = 0;
  TipSource tip = TipSource::counts;
  ModelKind kind = ModelKind::modes;
  std::uint16_t growth_ticks = 0xffff;  // as long as it is rendered
};

// Fills `message`. `friction` and `contact` are those of the full body, `contact` at stamp.tick, its triangle
// the body's own number. The basis is scaled per mode so that its largest entry is 32767: an entry is off by
// at most half a step, 1.5e-5 of that largest entry. Throws std::invalid_argument, naming the count and the
// bound, for a model beyond the capacities of the wire, and for one with numbers that single precision cannot
// hold.
void pack_model(const LocalModel& model, const ModelStamp& stamp, const ContactLaw<double>& law,
                SurfaceKind surface, const SurfaceFriction& friction, const ContactState<double>& contact,
                wire::ModelContents& message);

// The same for a force that the board is to hold until the next message: contact.force_N, with the mode and
// place of that contact.
void pack_held_force(const ModelStamp& stamp, const ContactLaw<double>& law,
                     const ContactState<double>& contact, wire::ModelContents& message);

// The same for a tip that nothing is near: no force, no horizon and no
// growth, whatever the stamp says.
void pack_nothing(const ModelStamp& stamp, const ContactLaw<double>& law, wire::ModelContents& message);

}  // namespace palpate::host
