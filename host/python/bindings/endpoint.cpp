// The host's end of the link, for a board on a serial line.
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "host/link/host_endpoint.hpp"
#include "host/link/transport.hpp"
#include "host/python/bindings/arrays.hpp"
#include "host/python/bindings/moving_body.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::python {
namespace {

nb::bytes to_bytes(const link::OutgoingFrame& frame) {
  return nb::bytes(frame.bytes.data(), frame.bytes.size());
}

template <class Text>
std::string text(const Text& from) {
  return {from.elements, from.elements + from.count};
}

// Messages that a script has no use for (of models and bases) come as their name alone.
struct ToDict {
  nb::dict result;

  void operator()(const palpate_ServoTrace_1_0& trace) {
    std::vector<float> tip_m, force_N;
    for (std::size_t i = 0; i < trace.samples.count; ++i) {
      const palpate_ServoSample_1_0& sample = trace.samples.elements[i];
      tip_m.insert(tip_m.end(), sample.tip_m, sample.tip_m + 3);
      force_N.insert(force_N.end(), sample.force_N, sample.force_N + 3);
    }
    result["message"] = "ServoTrace";
    result["first_tick"] = trace.first_tick;
    result["tip_m"] = array(std::move(tip_m), 3);
    result["force_N"] = array(std::move(force_N), 3);
  }
  void operator()(const palpate_BoardStatus_1_0& status) {
    result["message"] = "BoardStatus";
    result["tick"] = status.tick;
    result["mode"] = status.mode;
    result["faults"] = status.faults;
    result["last_status"] = status.last_status;
    result["schema_hash"] = status.schema_hash;
    result["token"] = status._token;
    result["models_taken"] = status.models_taken;
    result["frames_received"] = status.frames_received;
    result["frames_refused"] = status.frames_refused;
    result["frames_lost"] = status.frames_lost;
    result["missed_deadlines"] = status.missed_deadlines;
  }
  void operator()(const link::CommandResponse& response) {
    result["message"] = "Command";
    result["transfer_id"] = response.transfer_id;
    result["status"] = response.message.status;
    result["mode"] = response.message.mode;
    result["token"] = response.message._token;
  }
  void operator()(const link::InfoResponse& response) {
    const palpate_GetInfo_Response_1_0& info = response.message;
    result["message"] = "GetInfo";
    result["transfer_id"] = response.transfer_id;
    result["schema_hash"] = info.schema_hash;
    result["board"] = text(info.board);
    result["firmware"] = text(info.firmware);
    result["max_modes"] = info.max_modes;
    result["max_nodes"] = info.max_nodes;
    result["basis_slots"] = info.basis_slots;
    result["tick_rate_Hz"] = info.tick_rate_Hz;
    result["tip_history_ticks"] = info.tip_history_ticks;
  }
  void operator()(const palpate_TipTrace_1_0& trace) {
    std::vector<float> tip_m;
    for (std::size_t i = 0; i <= trace.offsets.count; ++i) {
      const Vec3d place_m = wire::read_tip(trace, i);
      for (const double value_m : {place_m.x, place_m.y, place_m.z})
        tip_m.push_back(static_cast<float>(value_m));
    }
    result["message"] = "TipTrace";
    result["first_tick"] = trace.first_tick;
    result["tip_m"] = array(std::move(tip_m), 3);
  }
  void operator()(const link::RegisterAnswer& answer) {
    const wire::RegisterValue& value = answer.message.value;
    result["message"] = "RegisterAccess";
    result["transfer_id"] = answer.transfer_id;
    result["read_us"] = answer.message.read_us;
    result["mutable"] = answer.message.is_mutable;
    result["persistent"] = answer.message.is_persistent;
    result["value"] = nb::none();  // there is none of that name
    if (value.type == wire::RegisterType::empty || value.type == wire::RegisterType::other) return;
    nb::list numbers;
    for (std::size_t i = 0; i < value.count; ++i) {
      if (value.type == wire::RegisterType::real32)
        numbers.append(std::bit_cast<float>(value.bits[i]));
      else
        numbers.append(std::bit_cast<std::int32_t>(value.bits[i]));
    }
    result["value"] = numbers;
  }
  void operator()(const link::RegisterName& answer) {
    result["message"] = "RegisterList";
    result["transfer_id"] = answer.transfer_id;
    result["name"] = answer.name;
  }
  void operator()(const palpate_DeviceState_1_0&) { result["message"] = "DeviceState"; }
  void operator()(const palpate_ModelReport_1_0&) { result["message"] = "ModelReport"; }
  void operator()(const palpate_BasisReport_1_0&) { result["message"] = "BasisReport"; }
};

}  // namespace

void bind_endpoint(nb::module_& module) {
  using namespace nanobind::literals;
  using link::Transport;
  nb::class_<Transport>(module, "Transport")
      .def(nb::new_([](const std::string& address) { return link::open_transport(address); }), "address"_a)
      .def(
          "write",
          [](Transport& t, const nb::bytes& data) {
            return t.write({static_cast<const std::uint8_t*>(data.data()), data.size()});
          },
          "frame"_a)
      .def(
          "read",
          [](Transport& t, double longest_s) {
            const auto longest = std::chrono::microseconds(static_cast<std::int64_t>(longest_s * 1e6));
            std::vector<std::uint8_t> bytes;
            {
              const nb::gil_scoped_release no_gil;
              bytes = t.read(longest);
            }
            return nb::bytes(bytes.data(), bytes.size());
          },
          "longest_s"_a)
      .def_prop_ro("is_open", &Transport::is_open)
      .def_prop_ro("address", &Transport::address);

  using link::HostEndpoint;
  nb::class_<HostEndpoint>(module, "HostEndpoint")
      .def(
          "__init__",
          [](HostEndpoint* self, const Transport* link) {
            link::EndpointOptions options;
            options.first_transfer_id = link::fresh_transfer_id();
            if (link != nullptr) options.framing = link->framing();
            new (self) HostEndpoint(options);
          },
          "link"_a.none())
      .def(
          "command",
          [](HostEndpoint& e, std::uint8_t action, std::uint32_t token) {
            palpate_Command_Request_1_0 request{};
            request.action = action;
            request._token = token;
            const link::OutgoingFrame frame = e.encode(request);
            return nb::make_tuple(to_bytes(frame), frame.transfer_id);
          },
          "action"_a, "token"_a)
      .def("get_info",
           [](HostEndpoint& e) {
             const link::OutgoingFrame frame = e.encode(palpate_GetInfo_Request_1_0{});
             return nb::make_tuple(to_bytes(frame), frame.transfer_id);
           })
      .def(
          "register_access",
          [](HostEndpoint& e, const std::string& name, const std::vector<float>& value) {
            wire::RegisterAccessRequest request{.name = name, .value = {}};
            if (value.size() > wire::kMaxRegisterValues)
              throw std::invalid_argument("register " + name + ": at most " +
                                          std::to_string(wire::kMaxRegisterValues) + " values");
            if (!value.empty()) request.value.type = wire::RegisterType::real32;
            for (const float one : value)
              request.value.bits[request.value.count++] = std::bit_cast<std::uint32_t>(one);
            const link::OutgoingFrame frame = e.encode(request);
            return nb::make_tuple(to_bytes(frame), frame.transfer_id);
          },
          "name"_a, "value"_a = std::vector<float>{})
      .def(
          "register_list",
          [](HostEndpoint& e, std::uint16_t index) {
            const link::OutgoingFrame frame = e.encode(wire::RegisterListRequest{index});
            return nb::make_tuple(to_bytes(frame), frame.transfer_id);
          },
          "index"_a)
      .def(
          "direct_force",
          [](HostEndpoint& e, const std::array<float, 3>& force_N) {
            palpate_DirectForce_1_0 message{};
            std::copy(force_N.begin(), force_N.end(), message.force_N);
            return to_bytes(e.encode(message));
          },
          "force_N"_a)
      .def(
          "receive",
          [](HostEndpoint& e, const nb::bytes& data, std::uint32_t tick) {
            nb::list messages;
            const std::span bytes{static_cast<const std::uint8_t*>(data.data()), data.size()};
            for (const link::Incoming& message : e.receive(bytes, tick)) {
              ToDict to{};
              std::visit(to, message);
              messages.append(to.result);
            }
            return messages;
          },
          "data"_a, "tick"_a)
      .def_prop_ro("counters", [](const HostEndpoint& e) {
        const link::EndpointCounters c = e.counters();
        nb::dict result;
        result["frames_sent"] = c.frames_sent;
        result["frames_received"] = c.frames_received;
        result["frames_refused"] = c.frames_refused;
        result["frames_lost"] = c.frames_lost;
        result["schema_mismatches"] = c.schema_mismatches;
        return result;
      });
}

}  // namespace palpate::python
