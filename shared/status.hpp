// What happened to an input. Values travel over the link and stand in records: never renumber them.
#pragma once

#include <cstdint>

namespace palpate {

enum class [[nodiscard]] Status : std::uint8_t{
    ok = 0,
    // framing (shared/wire)
    frame_too_long = 1,   // more bytes than the receiver's buffer before a delimiter
    frame_too_short = 2,  // fewer bytes than a header and a CRC
    cobs_invalid = 3,     // not a COBS encoding
    header_crc_mismatch = 4, header_version_unknown = 5, payload_crc_mismatch = 6,
    not_a_single_frame = 7,   // a fragment of a multi-frame transfer: not used on a serial link
    can_record_invalid = 8,   // bytes that are no CAN record
    transfer_incomplete = 9,  // of a transfer in several CAN frames some are missing or do not fit together
    too_many_transfers = 10,  // more of them at once than the receiver can put together
    not_for_can = 11,         // a node, subject or service that a CAN identifier cannot name
    // messages
    port_unknown = 16,       // no such subject or service here
    payload_malformed = 17,  // the DSDL decoder refused it
    schema_mismatch = 18,    // peer was built from other message definitions
    // local models
    model_too_large = 32,     // modes, nodes, triangles or basis beyond the fixed capacities
    model_not_finite = 33,    // NaN or infinity in it
    model_inconsistent = 34,  // counts that do not fit together, an index out of range
    model_too_old = 35,       // its tick is no longer in the tip history: cannot be rolled forward
    model_superseded = 36,    // a newer one came before this one was in use, or it came twice
    model_from_future = 37,   // its tick has not happened yet
    // bases of local models
    basis_missing = 38,       // not all of it has come
    basis_part_invalid = 39,  // a piece that does not fit in the basis that it says it is of
    basis_crc_mismatch = 40,  // all of it has come, but its bytes are not those that its identifier names
    basis_dropped = 41,       // its room was taken for a newer one before it was complete
    // commands
    command_refused = 48,      // not allowed in this mode
    command_token_wrong = 49,  // arming without the token of the board's last challenge
};

}  // namespace palpate
