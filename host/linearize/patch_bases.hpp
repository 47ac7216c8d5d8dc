// The patch around a contact with the basis of its surface nodes, or the one before as long as it will do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host/linearize/basis_source.hpp"
#include "host/linearize/patch_selection.hpp"
#include "host/linearize/stored_basis.hpp"
#include "host/msd/body.hpp"
#include "host/msd/surface_point.hpp"

namespace palpate::host {

struct PatchBasis {
  SurfacePoint chosen_around;
  std::vector<int> nodes;  // of the patch
  SubsetSurface surface;   // whose nodes are the ports
  Ports ports;             // in the basis's order
  std::shared_ptr<const StoredBasis> span;
};

class PatchBases {
 public:
  // near_nodes: as many free nodes below the surface are ports, too (nodes_below), those nearest to its
  // middle. A patch has at most port_limit ports on the surface: at the body's edges, where more nodes are on
  // the surface, those nearest to the contact. The body must outlive it. Throws as BasisSource does.
  PatchBases(const Body& body, const PatchSize& size, int port_limit, const Shifts& shifts,
             const BasisPolicy& policy, int near_nodes = 0)
      : body_(body),
        size_(size),
        port_limit_(port_limit),
        near_nodes_(near_nodes),
        middle_(!shifts.middle_rad_s.empty()),
        source_(body, shifts, policy) {}

  // The contacts that are there or expected, the most urgent first. Once before the patches of a tick.
  void foresee(std::uint32_t tick, std::span<const SurfacePoint> contacts);

  // The patch around the contact; while its basis is not there yet, the one that was given last, if the
  // contact lies on its surface. Null: neither. It stays until the next call.
  const PatchBasis* at(const SurfacePoint& contact);

  [[nodiscard]] const BasisSource& source() const { return source_; }
  // How often the patch around the contact had no basis yet.
  [[nodiscard]] std::size_t waits() const { return waits_; }

 private:
  [[nodiscard]] PatchBasis wanted(const SurfacePoint& contact) const;

  const Body& body_;
  PatchSize size_;
  int port_limit_, near_nodes_;
  bool middle_;  // the ports in the middle have frequencies of their own
  BasisSource source_;
  PatchBasis last_;
  std::size_t waits_ = 0;
};

}  // namespace palpate::host
