// Loops in real time, for the GUI.
#include "host/session/live_loop.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <array>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/loop_datasets.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "host/python/bindings/scene.hpp"
#include "host/session/attached_loop.hpp"

namespace palpate::python {
namespace {

using host::AttachedLoop;
using host::LiveLoop;

std::unique_ptr<LiveLoop> make_live_loop(const nb::dict& scene, int actuator_fd, int sensor_fd,
                                         const std::string& cache_folder) {
  host::Body body = read_body(scene);
  host::BodyState start = read_start(scene, body);
  host::ClosedLoopConfig config = read_closed_loop(scene, body, cache_folder);
  config.arms_by_itself = false;
  config.session_beside = true;
  config.session.model.bases.timing = host::BasisTiming::as_it_comes;
  // Nothing of a script: a person is there.
  config.overlong_ticks.clear();
  config.emergency_stop_ticks.clear();
  config.supply_low_ticks.clear();
  config.reset_ticks.clear();
  config.encoder_slips.clear();
  config.faults_down.clear();
  config.faults_up.clear();
  config.troubles = {};
  link::MeteredLinkOptions medium = read_link(scene);
  medium.errors = {};
  const plant::PlantParameters parameters = read_plant(scene);
  const plant::TipPath path = read_path(scene);
  host::LiveSetup setup{.body = std::move(body),
                        .start = std::move(start),
                        .plant = parameters,
                        .path = path,
                        .board = std::make_unique<host::FileDescriptorPeer>(actuator_fd, sensor_fd),
                        .link = link::make_metered_link(medium),
                        .loop = std::move(config)};
  return std::make_unique<LiveLoop>(std::move(setup));
}

std::unique_ptr<AttachedLoop> make_attached_loop(const nb::dict& scene, const std::string& address,
                                                 const std::string& cache_folder) {
  host::Body body = read_body(scene);
  host::BodyState start = read_start(scene, body);
  host::ClosedLoopConfig config = read_closed_loop(scene, body, cache_folder);
  config.session.model.bases.timing = host::BasisTiming::as_it_comes;
  return std::make_unique<AttachedLoop>(host::AttachedSetup{.body = std::move(body),
                                                            .start = std::move(start),
                                                            .plant = read_plant(scene),
                                                            .address = address,
                                                            .loop = std::move(config)});
}

firmware::Action action(const std::string& name) {
  if (name == "disarm") return firmware::Action::disarm;
  if (name == "calibrate") return firmware::Action::calibrate;
  if (name == "clear_fault") return firmware::Action::clear_fault;
  if (name == "stop") return firmware::Action::stop;
  throw std::invalid_argument("action is \"" + name + "\", allowed: calibrate, clear_fault, disarm, stop");
}

bool is_to_board(const std::string& direction) {
  if (direction == "down") return true;
  if (direction == "up") return false;
  throw std::invalid_argument("direction is \"" + direction + "\", allowed: down, up");
}

link::FaultKind fault_kind(const std::string& name) {
  if (name == "drop") return link::FaultKind::drop;
  if (name == "flip_bit") return link::FaultKind::flip_bit;
  if (name == "truncate") return link::FaultKind::truncate;
  if (name == "duplicate") return link::FaultKind::duplicate;
  if (name == "reorder") return link::FaultKind::reorder;
  throw std::invalid_argument("fault is \"" + name +
                              "\", allowed: drop, duplicate, flip_bit, reorder, truncate");
}

nb::dict take(host::LiveFeed& feed) {
  const std::vector<host::LiveTick> ticks = feed.take_ticks();
  std::vector<host::LoopTick> rows;
  rows.reserve(ticks.size());
  for (const host::LiveTick& tick : ticks) rows.push_back(tick.loop);
  nb::dict result;
  add_ticks(result, rows);
  add_updates(result, feed.take_updates());
  result["wall/late_s"] = column<float>(ticks, [](const host::LiveTick& t) { return t.late_s; });
  result["wall/took_s"] = column<float>(ticks, [](const host::LiveTick& t) { return t.took_s; });
  return result;
}

nb::object picture(host::LiveFeed& feed) {
  const auto shown = feed.take_picture();
  if (!shown) return nb::none();
  nb::dict result;
  result["tick"] = shown->tick;
  result["position_m"] = nodes_by_3(shown->state.position_m);
  result["velocity_m_s"] = nodes_by_3(shown->state.velocity_m_s);
  result["patch_nodes"] = column<std::uint32_t>(shown->patch_nodes, [](int node) { return node; });
  return result;
}

nb::dict status(const host::LiveFeed& feed) {
  const host::LiveStatus now = feed.status();
  nb::dict result;
  result["tick"] = now.tick;
  result["running"] = now.running;
  result["error"] = now.error;
  result["slipped_s"] = now.slipped_s;
  result["ticks_unseen"] = now.ticks_unseen;
  result["links_opened"] = now.links_opened;
  result["link_is_open"] = now.link_is_open;
  result["link_trouble"] = now.link_trouble;
  add_counters(result, now.counters);
  result["down"] = medium_counters(now.down);
  result["up"] = medium_counters(now.up);
  result["troubles"] = trouble_counters(now.troubles);
  result["board_heard"] = now.board.has_value();
  const palpate_BoardStatus_1_0 board = now.board.value_or(palpate_BoardStatus_1_0{});
  result["board_tick"] = board.tick;
  result["board_mode"] = board.mode;
  result["board_faults"] = board.faults;
  result["board_last_status"] = board.last_status;
  result["board_missed_deadlines"] = board.missed_deadlines;
  result["board_worst_tick_count"] = board.worst_tick_count;
  result["board_clock_Hz"] = board.clock_Hz;
  result["board_frames_refused"] = board.frames_refused;
  return result;
}

template <class Loop>
void bind_feed(nb::class_<Loop>& loop) {
  loop.def("take", [](Loop& self) { return take(self.feed()); })
      .def("take_picture", [](Loop& self) { return picture(self.feed()); })
      .def_prop_ro("status", [](const Loop& self) { return status(self.feed()); });
}

}  // namespace

void bind_live_loop(nb::module_& module) {
  using namespace nanobind::literals;
  using release = nb::call_guard<nb::gil_scoped_release>;
  module.def(
      "triangle_friction",
      [](const nb::dict& scene) { return triangle_friction(read_body(scene), read_friction(scene)); },
      "scene"_a);
  auto emulated =
      nb::class_<LiveLoop>(module, "LiveLoop")
          .def(nb::new_(&make_live_loop), "scene"_a, "actuator_fd"_a, "sensor_fd"_a, "cache_folder"_a)
          .def("start", &LiveLoop::start)
          .def("stop", &LiveLoop::stop, release())
          .def(
              "guide_hand",
              [](LiveLoop& live, double x_m, double y_m, double z_m) {
                return live.guide_hand({x_m, y_m, z_m});
              },
              "x_m"_a, "y_m"_a, "z_m"_a)
          .def("play_path", &LiveLoop::play_path)
          .def("set_grip", &LiveLoop::set_grip, "grip"_a)
          .def("arm", &LiveLoop::arm)
          .def(
              "command", [](LiveLoop& live, const std::string& name) { live.command(action(name)); },
              "action"_a)
          .def("set_emergency_stop", &LiveLoop::set_emergency_stop, "is_open"_a)
          .def("set_unplugged", &LiveLoop::set_unplugged, "unplugged"_a)
          .def("set_babbling", &LiveLoop::set_babbling, "babbling"_a)
          .def("burn_next_tick", &LiveLoop::burn_next_tick)
          .def(
              "add_faults",
              [](LiveLoop& live, const std::string& direction, const std::string& kind, std::size_t argument,
                 std::uint32_t count) {
                live.add_faults(is_to_board(direction), fault_kind(kind), argument, count);
              },
              "direction"_a, "kind"_a, "argument"_a, "count"_a)
          .def("set_host_delay", &LiveLoop::set_host_delay, "ticks"_a)
          .def("set_speed", &LiveLoop::set_speed, "speed"_a);
  bind_feed(emulated);

  auto attached =
      nb::class_<AttachedLoop>(module, "AttachedLoop")
          .def(nb::new_(&make_attached_loop), "scene"_a, "address"_a, "cache_folder"_a)
          .def("start", &AttachedLoop::start)
          .def("stop", &AttachedLoop::stop, release())
          .def("arm", &AttachedLoop::arm)
          .def(
              "command", [](AttachedLoop& loop, const std::string& name) { loop.command(action(name)); },
              "action"_a)
          .def("set_host_delay", &AttachedLoop::set_host_delay, "ticks"_a);
  bind_feed(attached);
}

}  // namespace palpate::python
