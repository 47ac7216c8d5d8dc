#include "host/session/live_feed.hpp"

#include <utility>

namespace palpate::host {

void LiveFeed::add(const LiveTick& tick) {
  const std::lock_guard lock(mutex_);
  ticks_.push_back(tick);
  if (ticks_.size() > kMostTicks) {
    ticks_.pop_front();
    ++status_.ticks_unseen;
  }
}

std::shared_ptr<const LivePicture> LiveFeed::new_picture(const LoopHost& host) const {
  // A copy of the body costs time: not for nobody.
  if (host.is_busy()) return nullptr;
  const Session& session = host.session();
  {
    const std::lock_guard lock(mutex_);
    if (!picture_wanted_ || (picture_ && session.tick() == picture_->tick)) return nullptr;
  }
  return std::make_shared<LivePicture>(LivePicture{session.tick(), session.state(), host.patch_nodes()});
}

void LiveFeed::look_at(LoopHost& host, std::uint32_t tick) {
  std::shared_ptr<const LivePicture> picture = new_picture(host);
  const std::lock_guard lock(mutex_);
  if (picture) {
    picture_ = std::move(picture);
    picture_wanted_ = false;
  }
  take_over_updates(host, tick);
  status_.tick = tick;
  status_.counters = host.counters();
  status_.board = host.board_status();
}

void LiveFeed::take_over_updates(LoopHost& host, std::uint32_t tick) {
  // They are not kept for ever.
  if (updates_given_ >= kMostUpdates) {
    host.forget_updates(updates_given_);
    updates_given_ = 0;
  }
  const std::vector<UpdateRecord>& all = host.updates();
  for (; updates_given_ < all.size(); ++updates_given_) {
    const UpdateRecord& update = all[updates_given_];
    // Of a board that has started again it is older than its ticks can say: settled, too.
    const std::uint32_t age_ticks = tick - update.sent_tick;
    if (update.status == UpdateRecord::kNeverHeard && age_ticks < kUpdateSettles_ticks) return;
    updates_.push_back(update);
    if (updates_.size() > kMostUpdates) updates_.pop_front();
  }
}

void LiveFeed::edit(const std::function<void(LiveStatus&)>& change) {
  const std::lock_guard lock(mutex_);
  change(status_);
}

std::vector<LiveTick> LiveFeed::take_ticks() {
  std::deque<LiveTick> taken;
  {
    const std::lock_guard lock(mutex_);
    taken.swap(ticks_);
  }
  return {taken.begin(), taken.end()};
}

std::vector<UpdateRecord> LiveFeed::take_updates() {
  std::deque<UpdateRecord> taken;
  {
    const std::lock_guard lock(mutex_);
    taken.swap(updates_);
  }
  return {taken.begin(), taken.end()};
}

std::shared_ptr<const LivePicture> LiveFeed::take_picture() {
  const std::lock_guard lock(mutex_);
  if (picture_wanted_) return nullptr;
  picture_wanted_ = true;
  return picture_;
}

LiveStatus LiveFeed::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace palpate::host
