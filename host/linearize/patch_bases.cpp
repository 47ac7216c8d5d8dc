#include "host/linearize/patch_bases.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::host {

Ports PatchBases::below(const PatchBasis& patch) const {
  const Eigen::Matrix3Xd& rest_m = body_.rest_position_m();
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const int node : patch.nodes) middle_m += rest_m.col(node) / static_cast<double>(patch.nodes.size());
  Ports nodes;
  for (const int node : patch.nodes)
    if (!body_.fixed(node) && !std::binary_search(patch.surface.node.begin(), patch.surface.node.end(), node))
      nodes.push_back(node);
  // In millionths of the patch's size, so that equal distances stay in the order of their nodes.
  const double size_m2 = (rest_m.col(patch.nodes.front()) - middle_m).squaredNorm();
  const auto distance = [&](int node) {
    return std::llround(1e6 * (rest_m.col(node) - middle_m).squaredNorm() / size_m2);
  };
  std::stable_sort(nodes.begin(), nodes.end(), [&](int a, int b) { return distance(a) < distance(b); });
  if (std::ssize(nodes) > near_nodes_) nodes.resize(static_cast<std::size_t>(near_nodes_));
  return nodes;
}

PatchBasis PatchBases::wanted(const SurfacePoint& contact) const {
  PatchBasis patch;
  patch.nodes = select_patch(body_, contact, size_);
  patch.surface = subset_surface(body_, patch.nodes, contact, port_limit_);
  patch.ports = patch.surface.node;
  if (middle_) {
    const std::vector<int> cell = cell_face(body_, contact.triangle);
    std::stable_partition(patch.ports.begin(), patch.ports.end(),
                          [&](int node) { return std::find(cell.begin(), cell.end(), node) != cell.end(); });
  }
  if (near_nodes_ > 0) {
    const Ports more = below(patch);
    patch.ports.insert(patch.ports.end(), more.begin(), more.end());
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
