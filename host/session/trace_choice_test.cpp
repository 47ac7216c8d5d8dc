#include "host/session/trace_choice.hpp"

#include <gtest/gtest.h>

namespace palpate::host {
namespace {

constexpr std::uint8_t kFull = palpate_TraceRequest_1_0_FORM_FULL, kTip = palpate_TraceRequest_1_0_FORM_TIP;

palpate_BoardStatus_1_0 sending(std::uint8_t form, std::uint8_t ticks) {
  palpate_BoardStatus_1_0 status{};
  status.trace_form = form;
  status.trace_ticks = ticks;
  return status;
}

TEST(TraceChoice, SaysNothingBeforeTheBoardDoesNorWhenItIsAsWished) {
  TraceChoice full({});
  EXPECT_FALSE(full.poll());
  full.take(sending(kFull, 4));
  EXPECT_FALSE(full.poll());
}

TEST(TraceChoice, AsksOncePerStatusUntilItIsAsWished) {
  TraceChoice tips({TraceForm::tip, 8});
  for (const auto& [form, ticks] : {std::pair{kFull, 4}, std::pair{kFull, 8}, std::pair{kTip, 4}}) {
    tips.take(sending(form, static_cast<std::uint8_t>(ticks)));
    const auto request = tips.poll();
    ASSERT_TRUE(request);
    EXPECT_EQ(request->count, 0u);
    EXPECT_EQ(request->form, kTip);
    EXPECT_EQ(request->ticks, 8u);
    EXPECT_FALSE(tips.poll());
  }
  tips.take(sending(kTip, 8));
  EXPECT_FALSE(tips.poll());
  tips.take(sending(kFull, 4));  // the board has started again
  EXPECT_TRUE(tips.poll());
}

TEST(TraceChoice, EveryRequestSaysTheWish) {
  const TraceChoice tips({TraceForm::tip, 8});
  const auto request = tips.request({1000, 12});
  EXPECT_EQ(request.first_tick, 1000u);
  EXPECT_EQ(request.count, 12u);
  EXPECT_EQ(request.form, kTip);
  EXPECT_EQ(request.ticks, 8u);
  EXPECT_EQ(tips.request({1000, 257}).count, 256u);
}

}  // namespace
}  // namespace palpate::host
