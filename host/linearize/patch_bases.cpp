#include "host/linearize/patch_bases.hpp"

#include <algorithm>
#include <utility>

namespace palpate::host {

PatchBasis PatchBases::wanted(const SurfacePoint& contact) const {
  PatchBasis patch;
  patch.nodes = select_patch(body_, contact, size_);
  patch.surface = subset_surface(body_, patch.nodes, contact, port_limit_);
  return patch;
}

void PatchBases::foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts) {
  std::vector<Ports> ports;
  for (const SurfacePoint& contact : contacts) {
    Ports next = wanted(contact).surface.node;
    if (std::find(ports.begin(), ports.end(), next) == ports.end()) ports.push_back(std::move(next));
  }
  source_.want(tick, ports);
}

const PatchBasis* PatchBases::at(const SurfacePoint& contact) {
  PatchBasis patch = wanted(contact);
  patch.span = source_.find(patch.surface.node);
  if (patch.span) {
    last_ = std::move(patch);
    return &last_;
  }
  ++waits_;
  const std::vector<int>& known = last_.surface.triangle;
  if (last_.span && std::binary_search(known.begin(), known.end(), contact.triangle)) return &last_;
  return nullptr;
}

}  // namespace palpate::host
