#include "host/linearize/patch_bases.hpp"

#include <algorithm>
#include <utility>

namespace palpate::host {

PatchBasis PatchBases::wanted(const SurfacePoint& contact) const {
  PatchBasis patch;
  patch.chosen_around = contact;
  patch.nodes = select_patch(body_, contact, size_);
  patch.surface = subset_surface(body_, patch.nodes, contact, port_limit_);
  patch.ports = patch.surface.node;
  if (middle_) {
    const std::vector<int> cell = cell_face(body_, contact.triangle);
    std::stable_partition(patch.ports.begin(), patch.ports.end(),
                          [&](int node) { return std::find(cell.begin(), cell.end(), node) != cell.end(); });
  }
  if (near_nodes_ > 0) {
    Ports below = nodes_below(body_, patch.nodes, patch.surface.node);
    std::erase_if(below, [this](int node) { return body_.fixed(node); });
    if (std::ssize(below) > near_nodes_) below.resize(static_cast<std::size_t>(near_nodes_));
    patch.ports.insert(patch.ports.end(), below.begin(), below.end());
  }
  return patch;
}

void PatchBases::foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts) {
  std::vector<Ports> ports;
  for (const SurfacePoint& contact : contacts) {
    Ports next = wanted(contact).ports;
    if (std::find(ports.begin(), ports.end(), next) == ports.end()) ports.push_back(std::move(next));
  }
  source_.want(tick, ports);
}

const PatchBasis* PatchBases::at(const SurfacePoint& contact) {
  PatchBasis patch = wanted(contact);
  patch.span = source_.find(patch.ports);
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
