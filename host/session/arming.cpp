#include "host/session/arming.hpp"

namespace palpate::host {
namespace {

// It renders, be it for another program, or goes on by itself, or a person has to look after it.
bool needs_no_arming(std::uint8_t mode) {
  return mode == palpate_BoardStatus_1_0_MODE_RENDER || mode == palpate_BoardStatus_1_0_MODE_DIRECT ||
         mode == palpate_BoardStatus_1_0_MODE_SUSPENDED || mode == palpate_BoardStatus_1_0_MODE_FAULT;
}

}  // namespace

std::optional<palpate_Command_Request_1_0> Arming::poll(std::uint32_t tick) {
  if (done_ || !idle_) return std::nullopt;
  if (token_ == 0 && asked_tick_ && tick - *asked_tick_ < kRetry_ticks) return std::nullopt;
  palpate_Command_Request_1_0 request{};
  request.action =
      token_ == 0 ? palpate_Command_Request_1_0_ARM_REQUEST : palpate_Command_Request_1_0_ARM_CONFIRM;
  request._token = token_;
  token_ = 0;  // a confirmation that is not answered starts the handshake afresh
  asked_tick_ = tick;
  return request;
}

void Arming::take(const palpate_BoardStatus_1_0& status) {
  if (status.mode == palpate_BoardStatus_1_0_MODE_IDLE) idle_ = true;
  if (needs_no_arming(status.mode)) done_ = true;
}

void Arming::take(const palpate_Command_Response_1_0& response) {
  if (needs_no_arming(response.mode)) done_ = true;
  if (!done_ && response.status == static_cast<std::uint8_t>(Status::ok)) token_ = response._token;
}

}  // namespace palpate::host
