#include "host/bench/link_cost.hpp"

#include <string>
#include <vector>

#include "host/python/bindings/experiments.hpp"
#include "host/python/bindings/scene.hpp"

namespace palpate::python {
namespace {

template <class Cost>
nb::dict message_of(const Cost& cost) {
  nb::dict row;
  row["message"] = nb::str(cost.message.c_str());
  row["message_bytes"] = cost.message_bytes;
  row["link_bytes"] = cost.link_bytes;
  row["to_board"] = cost.to_board;
  return row;
}

link::FramingKind framing_in(const nb::dict& scene) {
  return link::framing_of(read_link(scene).medium);
}

}  // namespace

nb::dict medium_limit(const nb::dict& scene, std::uint32_t ticks) {
  const host::bench::MediumLimit limit = host::bench::measure_medium_limit(read_link(scene), ticks);
  nb::dict result;
  result["message_bytes_per_s"] = limit.message_bytes_per_s;
  result["link_bytes_per_s"] = limit.link_bytes_per_s;
  result["busy_share"] = limit.busy_share;
  return result;
}

nb::list host_link_cost(const nb::dict& scene, std::uint32_t rounds) {
  nb::list rows;
  for (const host::bench::HostMessageCost& cost : host::bench::measure_host_cost(framing_in(scene), rounds)) {
    nb::dict row = message_of(cost);
    row["seconds"] = cost.seconds;
    row["copy_seconds"] = cost.copy_seconds;
    rows.append(row);
  }
  return rows;
}

nb::list board_link_cost(const nb::dict& scene, int actuator_fd, int sensor_fd, std::uint32_t rounds) {
  host::FileDescriptorPeer board(actuator_fd, sensor_fd);
  const link::FramingKind framing = framing_in(scene);
  std::vector<host::bench::BoardMessageCost> costs;
  {
    const nb::gil_scoped_release no_gil;  // for the board's watchdog
    costs = host::bench::measure_board_cost(board, framing, rounds);
  }
  nb::list rows;
  for (const host::bench::BoardMessageCost& cost : costs) {
    nb::dict row = message_of(cost);
    row["clock_counts"] = cost.clock_counts;
    rows.append(row);
  }
  return rows;
}

}  // namespace palpate::python
