#include "host/python/bindings/loop_datasets.hpp"

#include "host/python/bindings/arrays.hpp"

namespace palpate::python {

using host::LoopTick;
using host::UpdateRecord;

void add_ticks(nb::dict& result, const std::vector<LoopTick>& ticks) {
  result["ticks/tick"] = column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.tick; });
  result["ticks/encoder_count"] =
      columns3<std::int32_t>(ticks, [](const LoopTick& t) { return t.encoder_count; });
  result["ticks/measured_current_A"] =
      columns3<float>(ticks, [](const LoopTick& t) { return t.measured_current_A; });
  result["ticks/setpoint_A"] = columns3<float>(ticks, [](const LoopTick& t) { return t.board.setpoint_A; });
  result["ticks/enabled"] = column<std::uint8_t>(ticks, [](const LoopTick& t) { return t.board.enabled; });
  result["ticks/tip_m"] = columns3<float>(ticks, [](const LoopTick& t) { return t.board.tip_m; });
  result["ticks/force_N"] = columns3<float>(ticks, [](const LoopTick& t) { return t.board.force_N; });
  result["ticks/contact_mode"] =
      column<std::uint8_t>(ticks, [](const LoopTick& t) { return t.board.contact_mode; });
  result["ticks/triangle"] = column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.triangle; });
  result["ticks/barycentric"] = columns3<float>(ticks, [](const LoopTick& t) { return t.board.barycentric; });
  result["ticks/normal"] = columns3<float>(ticks, [](const LoopTick& t) { return t.board.normal; });
  result["ticks/mode"] = column<std::uint8_t>(ticks, [](const LoopTick& t) { return t.board.mode; });
  result["ticks/faults"] = column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.faults; });
  result["ticks/model_sequence"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.model_sequence; });
  result["ticks/model_age_ticks"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.model_age_ticks; });
  result["ticks/catch_up_ticks"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.catch_up_ticks; });
  result["ticks/true_tip_m"] = columns3<double>(ticks, [](const LoopTick& t) { return t.true_tip_m; });
  result["ticks/hand_target_m"] = columns3<double>(ticks, [](const LoopTick& t) { return t.hand_target_m; });
  result["ticks/hand_force_N"] = columns3<double>(ticks, [](const LoopTick& t) { return t.hand_force_N; });
  result["ticks/link_up_bytes"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.link_up_bytes; });
  result["ticks/link_down_bytes"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.link_down_bytes; });
  result["ticks/missed_deadlines"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.missed_deadlines; });
  result["ticks/background_overruns"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.background_overruns; });
  result["ticks/tick_count"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.tick_count; });
  result["ticks/busy_count"] =
      column<std::uint32_t>(ticks, [](const LoopTick& t) { return t.board.busy_count; });
}

void add_updates(nb::dict& result, const std::vector<UpdateRecord>& updates) {
  result["updates/sequence"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.sequence; });
  result["updates/tick"] = column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.tick; });
  result["updates/sent_tick"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.sent_tick; });
  result["updates/swap_tick"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.swap_tick; });
  result["updates/status"] = column<std::uint8_t>(updates, [](const UpdateRecord& u) { return u.status; });
  result["updates/modes"] = column<std::uint16_t>(updates, [](const UpdateRecord& u) { return u.modes; });
  result["updates/nodes"] = column<std::uint8_t>(updates, [](const UpdateRecord& u) { return u.nodes; });
  result["updates/bytes"] = column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.bytes; });
  result["updates/basis_bytes"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.basis_bytes; });
  result["updates/correction_energy_J"] =
      column<float>(updates, [](const UpdateRecord& u) { return u.correction_energy_J; });
  result["updates/interpolated_ticks"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.interpolated_ticks; });
  result["updates/interpolation_error_m"] =
      column<double>(updates, [](const UpdateRecord& u) { return u.interpolation_error_m; });
  result["updates/damping_coupling"] =
      column<double>(updates, [](const UpdateRecord& u) { return u.damping_coupling; });
  result["updates/limited_modes"] =
      column<std::uint32_t>(updates, [](const UpdateRecord& u) { return u.limited_modes; });
}

void add_counters(nb::dict& result, const host::LoopCounters& counters) {
  result["frames_lost_down"] = counters.frames_lost_down;
  result["frames_lost_up"] = counters.frames_lost_up;
  result["frames_repeated_up"] = counters.frames_repeated_up;
  result["frames_late_up"] = counters.frames_late_up;
  result["models_sent"] = counters.models_sent;
  result["models_taken"] = counters.models_taken;
  result["models_refused"] = counters.models_refused;
  result["basis_waits"] = counters.basis_waits;
}

nb::dict medium_counters(const link::MediumCounters& counters) {
  nb::dict result;
  result["bytes_accepted"] = counters.bytes_accepted;
  result["bytes_delivered"] = counters.bytes_delivered;
  result["bytes_dropped"] = counters.bytes_dropped;
  result["submissions_dropped"] = counters.submissions_dropped;
  result["attempts_failed"] = counters.attempts_failed;
  result["bus_offs"] = counters.bus_offs;
  result["busy_ticks"] = counters.busy_ticks;
  return result;
}

nb::dict trouble_counters(const host::TroubleCounters& counters) {
  const auto of = [](const host::DirectionTroubles& way) {
    nb::dict result;
    result["frames"] = way.frames;
    result["dropped"] = way.hit[link::FaultKind::drop];
    result["flipped"] = way.hit[link::FaultKind::flip_bit];
    result["truncated"] = way.hit[link::FaultKind::truncate];
    result["duplicated"] = way.hit[link::FaultKind::duplicate];
    result["reordered"] = way.hit[link::FaultKind::reorder];
    result["delayed"] = way.delayed;
    result["cut"] = way.cut;
    return result;
  };
  nb::dict result;
  result["down"] = of(counters.down);
  result["up"] = of(counters.up);
  result["foreign_frames"] = counters.foreign_frames;
  return result;
}

}  // namespace palpate::python
