#include "host/python/bindings/scene.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/python/bindings/network.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::python {
namespace {

Vec3d vector(const nb::dict& table, const char* key) {
  const auto values = nb::cast<std::vector<double>>(table[key]);
  if (values.size() != 3) throw std::invalid_argument(std::string(key) + ": must be three numbers");
  return {values[0], values[1], values[2]};
}

std::string text(const nb::dict& table, const char* key) {
  return nb::cast<std::string>(table[key]);
}

std::vector<std::array<int, 3>> indices(const nb::dict& table, const char* key) {
  return nb::cast<std::vector<std::array<int, 3>>>(table[key]);
}

template <class T>
T choice(const std::string& value, const char* key,
         std::initializer_list<std::pair<const char*, T>> choices) {
  for (const auto& [name, meaning] : choices)
    if (value == name) return meaning;
  throw std::invalid_argument(std::string(key) + " = \"" + value + "\": not known to the core");
}

// way: "down" or "up".
std::vector<link::Fault> faults(const nb::dict& table, const std::string& way) {
  std::vector<link::Fault> faults;
  for (const std::uint32_t frame : whole_list(table, ("drop_" + way).c_str()))
    faults.push_back({frame, link::FaultKind::drop, 0});
  const auto add = [&](const char* key, link::FaultKind kind, const char* argument) {
    for (const nb::handle entry : nb::object(table[(key + way).c_str()])) {
      const auto fields = nb::cast<nb::dict>(entry);
      faults.push_back({whole(fields, "frame"), kind, whole(fields, argument)});
    }
  };
  add("flip_", link::FaultKind::flip_bit, "bit");
  add("duplicate_", link::FaultKind::duplicate, "behind");
  add("reorder_", link::FaultKind::reorder, "behind");
  return faults;
}

std::uint32_t tick_at(double time_s) {
  return static_cast<std::uint32_t>(std::lround(time_s / kTick_s));
}

host::TickSpan span(const nb::dict& fields) {
  return {tick_at(number(fields, "from_s")), tick_at(number(fields, "to_s"))};
}

template <class Each>
void for_each_of(const nb::dict& table, const char* key, Each each) {
  for (const nb::handle entry : nb::object(table[key])) each(nb::cast<nb::dict>(entry));
}

// A bit that flips on a bus: no frame arrives damaged, it goes again.
bool is_bus_error(const nb::dict& random, bool is_bus) {
  return is_bus && text(random, "kind") == "flip";
}

link::BusErrors read_bus_errors(const nb::dict& table) {
  link::BusErrors errors{.errors = {}, .seed = whole(table, "seed")};
  for_each_of(table, "random", [&](const nb::dict& fields) {
    if (!is_bus_error(fields, true)) return;
    const host::TickSpan when = span(fields);
    errors.errors.push_back({text(fields, "way") == "down" ? std::size_t{0} : std::size_t{1},
                             number(fields, "chance"), when.first_tick, when.end_tick});
  });
  return errors;
}

host::LinkTroubles read_troubles(const nb::dict& table, bool is_bus) {
  host::LinkTroubles troubles;
  troubles.seed = whole(table, "seed");
  for_each_of(table, "random", [&](const nb::dict& fields) {
    if (is_bus_error(fields, is_bus)) return;
    const host::TickSpan when = span(fields);
    auto& list = text(fields, "way") == "down" ? troubles.random_down : troubles.random_up;
    const auto kind = choice<link::FaultKind>(text(fields, "kind"), "link.faults.random.kind",
                                              {{"drop", link::FaultKind::drop},
                                               {"flip", link::FaultKind::flip_bit},
                                               {"truncate", link::FaultKind::truncate},
                                               {"duplicate", link::FaultKind::duplicate},
                                               {"reorder", link::FaultKind::reorder}});
    list.push_back({kind, number(fields, "chance"), when.first_tick, when.end_tick});
  });
  for_each_of(table, "delay", [&](const nb::dict& fields) {
    const host::TickSpan when = span(fields);
    auto& list = text(fields, "way") == "down" ? troubles.delay_down : troubles.delay_up;
    list.push_back({tick_at(number(fields, "delay_s")), tick_at(number(fields, "jitter_s")), when.first_tick,
                    when.end_tick});
  });
  for_each_of(table, "unplugged",
              [&](const nb::dict& fields) { troubles.unplugged.push_back(span(fields)); });
  for_each_of(table, "host_stopped",
              [&](const nb::dict& fields) { troubles.host_stopped.push_back(span(fields)); });
  for_each_of(table, "other_schema",
              [&](const nb::dict& fields) { troubles.other_schema.push_back(span(fields)); });
  for_each_of(table, "second_host",
              [&](const nb::dict& fields) { troubles.second_host.push_back(span(fields)); });
  for_each_of(table, "babble", [&](const nb::dict& fields) { troubles.babble.push_back(span(fields)); });
  for_each_of(table, "refused", [&](const nb::dict& fields) { troubles.refused.push_back(span(fields)); });
  for_each_of(table, "flood", [&](const nb::dict& fields) {
    troubles.flood.push_back({span(fields), number(fields, "load")});
  });
  return troubles;
}

}  // namespace

nb::dict table(const nb::dict& scene, const char* name) {
  return nb::cast<nb::dict>(scene[name]);
}
double number(const nb::dict& table, const char* key) {
  return nb::cast<double>(table[key]);
}
std::uint32_t whole(const nb::dict& table, const char* key) {
  return nb::cast<std::uint32_t>(table[key]);
}
std::vector<std::uint32_t> whole_list(const nb::dict& table, const char* key) {
  return nb::cast<std::vector<std::uint32_t>>(table[key]);
}

host::Body read_body(const nb::dict& scene) {
  const nb::dict body = table(scene, "body");
  if (!scene["network"].is_none()) return read_network(table(scene, "network"), vector(body, "gravity_m_s2"));
  host::LatticeSpec spec;
  spec.dimension = nb::cast<int>(body["dimension"]);
  spec.nodes = nb::cast<std::array<int, 3>>(body["nodes"]);
  spec.spacing_m = number(body, "spacing_m");
  spec.origin_m = vector(body, "origin_m");
  spec.mass_kg = number(body, "mass_kg");
  spec.stiffness_N_m = number(body, "stiffness_N_m");
  spec.damping_N_s_m = number(body, "damping_N_s_m");
  for (const nb::handle entry : nb::object(body["regions"])) {
    const auto region = nb::cast<nb::dict>(entry);
    spec.regions.push_back({nb::cast<std::array<int, 3>>(region["from_node"]),
                            nb::cast<std::array<int, 3>>(region["to_node"]), number(region, "mass_kg"),
                            number(region, "stiffness_N_m"), number(region, "damping_N_s_m")});
  }
  using host::Face;
  using host::Neighbours;
  spec.neighbours = choice<Neighbours>(
      text(body, "neighbours"), "body.neighbours",
      {{"axis", Neighbours::axis}, {"edge", Neighbours::edge}, {"full", Neighbours::full}});
  for (const auto& face : nb::cast<std::vector<std::string>>(body["fixed_faces"]))
    spec.fixed_faces.push_back(choice<Face>(face, "body.fixed_faces",
                                            {{"x-", Face::x_minus},
                                             {"x+", Face::x_plus},
                                             {"y-", Face::y_minus},
                                             {"y+", Face::y_plus},
                                             {"z-", Face::z_minus},
                                             {"z+", Face::z_plus}}));
  spec.fixed_nodes = indices(body, "fixed_nodes");
  spec.gravity_m_s2 = vector(body, "gravity_m_s2");
  return host::make_lattice(spec);
}

host::BodyState read_start(const nb::dict& scene, const host::Body& body) {
  const nb::dict values = table(scene, "body");
  const auto nodes = indices(values, "initial_nodes");
  const auto displacements = nb::cast<std::vector<std::array<double, 3>>>(values["initial_displacements_m"]);
  host::BodyState state = body.rest_state();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const int node = body.lattice()->node(nodes[i][0], nodes[i][1], nodes[i][2]);
    for (int axis = 0; axis < 3; ++axis)
      state.position_m(axis, node) += displacements.at(i)[static_cast<std::size_t>(axis)];
  }
  return state;
}

std::vector<host::NodeDrive> read_drives(const nb::dict& scene, const host::Body& body) {
  std::vector<host::NodeDrive> drives;
  for (const nb::handle entry : nb::object(table(scene, "body")["drives"])) {
    const auto fields = nb::cast<nb::dict>(entry);
    const auto node = nb::cast<std::array<int, 3>>(fields["node"]);
    drives.push_back({body.lattice()->node(node[0], node[1], node[2]), number(fields, "start_s"),
                      number(fields, "reach_s"), number(fields, "release_s"),
                      vector(fields, "displacement_m")});
  }
  return drives;
}

std::optional<int> read_probe_node(const nb::dict& scene, const host::Body& body) {
  const nb::object given = table(scene, "outputs")["probe_node"];
  if (given.is_none()) return std::nullopt;
  const auto node = nb::cast<std::array<int, 3>>(given);
  return body.lattice()->node(node[0], node[1], node[2]);
}

ContactLaw<double> read_contact(const nb::dict& scene) {
  const nb::dict coupling = table(scene, "coupling");
  return {number(table(scene, "tool"), "radius_m"),
          {number(coupling, "stiffness_N_m"), number(coupling, "damping_N_s_m")}};
}

SurfaceKind read_surface(const nb::dict& scene) {
  return choice<SurfaceKind>(text(table(scene, "contact"), "surface"), "contact.surface",
                             {{"smooth", SurfaceKind::smooth}, {"flat", SurfaceKind::flat}});
}

host::FrictionSpec read_friction(const nb::dict& scene) {
  const nb::dict contact = table(scene, "contact");
  const auto friction = [](const nb::dict& given) {
    return Friction<double>{number(given, "static_friction"), number(given, "kinetic_friction")};
  };
  host::FrictionSpec spec{.elsewhere = friction(contact), .regions = {}};
  for (const nb::handle entry : nb::object(contact["regions"])) {
    const auto region = nb::cast<nb::dict>(entry);
    spec.regions.push_back({vector(region, "from_m"), vector(region, "to_m"), friction(region)});
  }
  return spec;
}

plant::TipPath read_path(const nb::dict& scene) {
  const nb::dict path = table(scene, "path");
  const auto time_s =
      nb::cast<nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(path["time_s"]);
  const auto position_m =
      nb::cast<nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>>(
          path["position_m"]);
  std::vector<plant::TimedPosition> points;
  for (std::size_t i = 0; i < time_s.shape(0); ++i) {
    const double* x = position_m.data() + 3 * i;
    points.push_back({time_s.data()[i], {x[0], x[1], x[2]}});
  }
  return text(path, "interpolation") == "linear" ? plant::TipPath::samples(std::move(points))
                                                 : plant::TipPath::minimum_jerk(std::move(points));
}

plant::PlantParameters read_plant(const nb::dict& scene) {
  const nb::dict hand = table(scene, "hand"), device = table(scene, "device");
  plant::PlantParameters plant;
  plant.hand_kind = choice<plant::HandKind>(
      text(hand, "kind"), "hand.kind",
      {{"impedance", plant::HandKind::impedance}, {"scripted", plant::HandKind::scripted}});
  plant.grip = number(hand, "grip");
  plant.hand.mass_kg = number(hand, "mass_kg");
  plant.hand.stiffness_N_m = number(hand, "stiffness_N_m");
  plant.hand.damping_N_s_m = number(hand, "damping_N_s_m");
  plant.hand.grip_stiffness_N_m = number(hand, "grip_stiffness_N_m");
  plant.hand.grip_damping_N_s_m = number(hand, "grip_damping_N_s_m");
  plant.encoder_reference = nb::cast<std::array<std::int32_t, 3>>(device["encoder_reference"]);
  plant.amplifiers.bandwidth_Hz = number(device, "amplifier_bandwidth_Hz");
  plant.amplifiers.peak_A = number(device, "amplifier_peak_A");
  plant.amplifiers.offset_A = vector(device, "amplifier_offset_A");
  return plant;
}

host::BuilderConfig read_model(const nb::dict& model) {
  host::BuilderConfig config;
  const auto patch = nb::cast<std::array<int, 3>>(model["patch_nodes"]);
  config.builder = choice<host::Builder>(text(model, "builder"), "model.builder",
                                         {{"patch", host::Builder::patch},
                                          {"patch_rescaled", host::Builder::patch_rescaled},
                                          {"condensed", host::Builder::condensed},
                                          {"krylov", host::Builder::krylov},
                                          {"hybrid", host::Builder::hybrid}});
  config.tangent =
      choice<host::TangentAt>(text(model, "tangent"), "model.tangent",
                              {{"rest", host::TangentAt::rest}, {"frame", host::TangentAt::frame}});
  config.patch = {patch[0], patch[1], patch[2]};
  for (const double shift_Hz : nb::cast<std::vector<double>>(model["shifts_Hz"]))
    config.shift_rad_s.push_back(2.0 * std::numbers::pi * shift_Hz);
  for (const double shift_Hz : nb::cast<std::vector<double>>(model["middle_shifts_Hz"]))
    config.middle_shift_rad_s.push_back(2.0 * std::numbers::pi * shift_Hz);
  constexpr double kDefaultMiddle_Hz = 20.0;  // docs/decisions/near_field.md
  if (config.builder == host::Builder::hybrid && config.middle_shift_rad_s.empty())
    config.middle_shift_rad_s.push_back(2.0 * std::numbers::pi * kDefaultMiddle_Hz);
  config.near_nodes = static_cast<int>(whole(model, "near_nodes"));
  return config;
}

host::ClosedLoopConfig read_closed_loop(const nb::dict& scene, const host::Body& body,
                                        const std::string& cache_folder) {
  const nb::dict rates = table(scene, "rates"), model = table(scene, "model"), board = table(scene, "board");
  host::ClosedLoopConfig config;
  config.ticks = whole(scene, "duration_ticks");
  config.host_delay_ticks = whole(rates, "host_delay_ticks");
  config.models_under_way = whole(rates, "models_under_way");
  config.session.law = read_contact(scene);
  config.session.tip =
      choice<TipSource>(text(table(scene, "coupling"), "tip"), "coupling.tip",
                        {{"counts", TipSource::counts}, {"estimated", TipSource::estimated}});
  config.session.surface = read_surface(scene);
  config.session.friction = read_friction(scene);
  config.session.step_s = kTick_s / whole(table(scene, "integrator"), "steps_per_tick");
  config.session.update_Hz = number(rates, "model_update_Hz");
  config.session.model = read_model(model);
  config.session.patch_ahead = nb::cast<bool>(model["patch_ahead"]);
  host::BasisPolicy& bases = config.session.model.bases;
  bases.timing = host::BasisTiming::virtual_time;
  bases.latency_ticks = whole(model, "basis_latency_ticks");
  if (const std::uint64_t cache_MB = whole(model, "basis_cache_MB"); cache_MB > 0)
    bases.cache = {cache_folder, 1'000'000 * cache_MB};
  config.session.valid_ticks = nb::cast<std::uint16_t>(model["valid_ticks"]);
  if (!nb::object(model["growth_ticks"]).is_none())
    config.session.growth_ticks = nb::cast<std::uint16_t>(model["growth_ticks"]);
  config.session.feedback = choice<host::Feedback>(text(model, "feedback"), "model.feedback",
                                                   {{"exact", host::Feedback::exact},
                                                    {"paper", host::Feedback::paper},
                                                    {"discard", host::Feedback::discard},
                                                    {"hold", host::Feedback::hold}});
  config.session.drives = read_drives(scene, body);
  config.probe_node = read_probe_node(scene, body);
  for (const nb::handle entry : nb::object(table(scene, "hand")["grip_changes"])) {
    const auto change = nb::cast<nb::dict>(entry);
    config.grip_changes.push_back(
        {static_cast<std::uint32_t>(std::lround(number(change, "time_s") / kTick_s)),
         number(change, "grip")});
  }
  config.framing = link::framing_of(read_link(scene).medium);
  const nb::dict link = table(scene, "link");
  config.trace = {choice<host::TraceForm>(text(link, "trace"), "link.trace",
                                          {{"full", host::TraceForm::full}, {"tip", host::TraceForm::tip}}),
                  nb::cast<std::uint8_t>(link["trace_ticks"])};
  const nb::dict board_faults = table(board, "faults"), link_faults = table(link, "faults");
  // Board native catches up as mps2_an386 does.
  if (text(board, "name") == "mps2_an500") config.catch_up_policy = firmware::kCatchUpCortexM7;
  config.overlong_ticks = whole_list(board_faults, "overlong_ticks");
  config.emergency_stop_ticks = whole_list(board_faults, "emergency_stop_ticks");
  config.supply_low_ticks = whole_list(board_faults, "supply_low_ticks");
  config.reset_ticks = whole_list(board_faults, "reset_ticks");
  for_each_of(board_faults, "encoder_slips", [&](const nb::dict& fields) {
    config.encoder_slips.push_back(
        {whole(fields, "tick"), whole(fields, "joint"), nb::cast<std::int32_t>(fields["count"])});
  });
  config.faults_down = faults(link_faults, "down");
  config.faults_up = faults(link_faults, "up");
  config.troubles = read_troubles(link_faults, read_link(scene).medium != link::MediumKind::uart);
  return config;
}

link::MeteredLinkOptions read_link(const nb::dict& scene) {
  const nb::dict link = table(scene, "link");
  const auto medium = choice<link::MediumKind>(text(link, "medium"), "link.medium",
                                               {{"uart", link::MediumKind::uart},
                                                {"can", link::MediumKind::can},
                                                {"canfd", link::MediumKind::canfd},
                                                {"usb", link::MediumKind::usb}});
  return {.medium = medium,
          .baud = whole(link, "baud"),
          .bit_rate_Hz = whole(link, "bit_rate_Hz"),
          .data_bit_rate_Hz = whole(link, "data_bit_rate_Hz"),
          .queue_bytes = whole(link, "queue_bytes"),
          .errors =
              medium == link::MediumKind::uart ? link::BusErrors{} : read_bus_errors(table(link, "faults"))};
}

host::Method read_method(const nb::dict& scene) {
  return choice<host::Method>(
      text(table(scene, "integrator"), "method"), "integrator.method",
      {{"semi_implicit", host::Method::semi_implicit_euler}, {"implicit", host::Method::implicit_euler}});
}

}  // namespace palpate::python
