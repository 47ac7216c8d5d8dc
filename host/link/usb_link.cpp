#include "host/link/usb_link.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "host/link/usb_device.hpp"

namespace palpate::link {
namespace {

// A multiple of every packet size: a transfer that a packet overflows would be lost.
constexpr std::size_t kTransfer_bytes = 16384;
// Transfers each way that the kernel has at once: one is always waiting while another is looked at.
constexpr std::size_t kTransfers = 4;
// Of bytes that nobody has read; beyond it the device waits.
constexpr std::size_t kMostUnread_bytes = 1 << 20;
constexpr std::chrono::milliseconds kRescan{250};

[[noreturn]] void fail(const std::string& address, int error, const char* remedy = "") {
  throw TransportError(address + ": " + libusb_strerror(error) + remedy);
}

class UsbLink final : public Transport {
 public:
  UsbLink(UsbContext context, UsbHandle handle, const UsbInterface& interface, std::string address)
      : context_(std::move(context)),
        handle_(std::move(handle)),
        interface_(interface),
        address_(std::move(address)) {
    for (Slot& slot : in_) start_reading(slot);
    for (Slot& slot : out_) slot.transfer.reset(libusb_alloc_transfer(0));
    watch_for_unplugging();
    events_ = std::thread([this] { handle_events(); });
  }

  ~UsbLink() override {
    {
      const std::scoped_lock lock(mutex_);
      closing_ = true;
      for (const auto& slots : {&in_, &out_})
        for (const Slot& slot : *slots)
          if (slot.pending) libusb_cancel_transfer(slot.transfer.get());
    }
    libusb_interrupt_event_handler(context_.get());
    events_.join();
    libusb_release_interface(handle_.get(), interface_.number);
  }

  bool write(std::span<const std::uint8_t> frame) override {
    std::unique_lock lock(mutex_);
    Slot* free = nullptr;
    const auto ready = [&] {
      const auto found =
          std::find_if(out_.begin(), out_.end(), [](const Slot& slot) { return !slot.pending; });
      free = found == out_.end() ? nullptr : &*found;
      return !open_ || free != nullptr;
    };
    if (!changed_.wait_for(lock, kWritePatience, ready) || !open_) {
      ++frames_unsent_;
      return false;
    }
    free->bytes.assign(frame.begin(), frame.end());
    libusb_fill_bulk_transfer(free->transfer.get(), handle_.get(), interface_.out, free->bytes.data(),
                              static_cast<int>(free->bytes.size()), on_sent, this, 0);
    free->transfer->flags = LIBUSB_TRANSFER_ADD_ZERO_PACKET;
    if (submit(*free)) return true;
    ++frames_unsent_;
    return false;
  }

  std::vector<std::uint8_t> read(std::chrono::microseconds longest) override {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, longest, [this] { return !open_ || !unread_.empty(); });
    // What came before the device went is still read.
    std::vector<std::uint8_t> bytes = std::exchange(unread_, {});
    for (Slot& slot : in_)
      if (open_ && !slot.pending) submit(slot);
    return bytes;
  }

  [[nodiscard]] bool is_open() const override { return open_; }
  [[nodiscard]] std::string address() const override { return address_; }
  // Full speed carries 1.2 MB/s, high speed 53.
  [[nodiscard]] double bytes_per_s() const override { return 0.0; }
  [[nodiscard]] TransportCounters counters() const override {
    const std::scoped_lock lock(mutex_);
    return {.bytes_sent = bytes_sent_, .bytes_received = bytes_received_, .frames_unsent = frames_unsent_};
  }

 private:
  struct Slot {
    UsbTransfer transfer{};
    std::vector<std::uint8_t> bytes{};
    bool pending = false;  // the kernel has it
  };

  // The lock is held, but in the constructor.
  bool submit(Slot& slot) {
    const int error = libusb_submit_transfer(slot.transfer.get());
    slot.pending = error == 0;
    if (error == LIBUSB_ERROR_NO_DEVICE) close();
    return slot.pending;
  }

  void start_reading(Slot& slot) {
    slot.transfer.reset(libusb_alloc_transfer(0));
    slot.bytes.resize(kTransfer_bytes);
    libusb_fill_bulk_transfer(slot.transfer.get(), handle_.get(), interface_.in, slot.bytes.data(),
                              static_cast<int>(slot.bytes.size()), on_received, this, 0);
    submit(slot);
  }

  void close() {
    open_ = false;
    changed_.notify_all();
  }

  Slot& slot_of(std::array<Slot, kTransfers>& slots, const libusb_transfer* transfer) {
    return *std::find_if(slots.begin(), slots.end(),
                         [transfer](const Slot& slot) { return slot.transfer.get() == transfer; });
  }

  // In the thread of events, as the two below.
  static void LIBUSB_CALL on_sent(libusb_transfer* transfer) {
    auto* self = static_cast<UsbLink*>(transfer->user_data);
    const std::scoped_lock lock(self->mutex_);
    self->slot_of(self->out_, transfer).pending = false;
    self->bytes_sent_ += static_cast<std::uint64_t>(transfer->actual_length);
    if (transfer->status != LIBUSB_TRANSFER_COMPLETED) {
      ++self->frames_unsent_;
      self->close();
    }
    self->changed_.notify_all();
  }

  static void LIBUSB_CALL on_received(libusb_transfer* transfer) {
    auto* self = static_cast<UsbLink*>(transfer->user_data);
    const std::scoped_lock lock(self->mutex_);
    Slot& slot = self->slot_of(self->in_, transfer);
    slot.pending = false;
    self->unread_.insert(self->unread_.end(), slot.bytes.begin(),
                         slot.bytes.begin() + transfer->actual_length);
    self->bytes_received_ += static_cast<std::uint64_t>(transfer->actual_length);
    if (transfer->status != LIBUSB_TRANSFER_COMPLETED)
      self->close();
    else if (!self->closing_ && self->unread_.size() < kMostUnread_bytes)
      self->submit(slot);
    self->changed_.notify_all();
  }

  static int LIBUSB_CALL on_unplugged(libusb_context*, libusb_device* device, libusb_hotplug_event,
                                      void* user) {
    auto* self = static_cast<UsbLink*>(user);
    if (device != libusb_get_device(self->handle_.get())) return 0;
    const std::scoped_lock lock(self->mutex_);
    self->close();
    return 0;
  }

  // Where the system sends no hot-plug events the transfers tell.
  void watch_for_unplugging() {
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0) return;
    libusb_hotplug_register_callback(
        context_.get(), LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT, LIBUSB_HOTPLUG_NO_FLAGS, LIBUSB_HOTPLUG_MATCH_ANY,
        LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, on_unplugged, this, nullptr);
  }

  bool is_done() {
    const std::scoped_lock lock(mutex_);
    const auto pending = [](const Slot& slot) { return slot.pending; };
    return closing_ && std::none_of(in_.begin(), in_.end(), pending) &&
           std::none_of(out_.begin(), out_.end(), pending);
  }

  void handle_events() {
    while (!is_done()) libusb_handle_events(context_.get());
  }

  UsbContext context_;
  UsbHandle handle_;
  UsbInterface interface_;
  std::string address_;
  mutable std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  std::array<Slot, kTransfers> in_, out_;
  std::vector<std::uint8_t> unread_;
  std::uint64_t bytes_sent_ = 0, bytes_received_ = 0, frames_unsent_ = 0;
  bool closing_ = false;
  std::atomic<bool> open_{true};
  std::thread events_;
};

UsbHandle open_handle(const std::string& address, libusb_device* device) {
  libusb_device_handle* handle = nullptr;
  const int error = libusb_open(device, &handle);
  if (error == LIBUSB_ERROR_ACCESS) fail(address, error, ": a udev rule must give this user the device");
  if (error != 0) fail(address, error);
  return UsbHandle(handle);
}

UsbHandle open_only_device(const std::string& text, libusb_context* context, const UsbAddress& address) {
  UsbHandle found;
  std::string serials;
  std::size_t fitting = 0;
  const std::vector<UsbDevice> devices = usb_devices(context, address);
  for (const UsbDevice& device : devices) {
    UsbHandle handle = open_handle(text, device.get());
    const std::string serial = usb_serial(handle.get());
    serials += (serials.empty() ? "" : ", ") + serial;
    if (!address.serial.empty() && serial != address.serial) continue;
    ++fitting;
    found = std::move(handle);
  }
  if (fitting == 1) return found;
  if (devices.empty()) throw TransportError(text + ": no such device");
  throw TransportError(text + ": " + std::to_string(fitting) +
                       " devices fit, 1 is needed; serials: " + serials);
}

int LIBUSB_CALL on_arrived(libusb_context*, libusb_device*, libusb_hotplug_event, void* arrived) {
  *static_cast<int*>(arrived) = 1;
  return 0;
}

bool is_plugged_in(libusb_context* context, const UsbAddress& address) {
  const std::vector<UsbDevice> devices = usb_devices(context, address);
  return std::any_of(devices.begin(), devices.end(), [&address](const UsbDevice& device) {
    libusb_device_handle* handle = nullptr;
    if (address.serial.empty()) return true;
    if (libusb_open(device.get(), &handle) != 0) return false;
    return usb_serial(UsbHandle(handle).get()) == address.serial;
  });
}

}  // namespace

std::unique_ptr<Transport> open_usb(const UsbAddress& address) {
  const std::string text = text_of(address);
  UsbContext context = make_usb_context(text);
  UsbHandle handle = open_only_device(text, context.get(), address);
  const UsbInterface interface = find_bulk_interface(libusb_get_device(handle.get()));
  if (interface.in == 0)
    throw TransportError(text + ": no interface of the vendor's class with a bulk endpoint each way");
  if (const int error = libusb_claim_interface(handle.get(), interface.number); error != 0)
    fail(text, error, error == LIBUSB_ERROR_BUSY ? ": another program or a driver has it" : "");
  return std::make_unique<UsbLink>(std::move(context), std::move(handle), interface, text);
}

bool wait_for_usb(const UsbAddress& address, std::chrono::milliseconds longest) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + longest;
  for (;;) {
    // Made anew: without hot-plug events a context sees no later devices.
    const UsbContext context = make_usb_context(text_of(address));
    int arrived = 0;
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) != 0)
      libusb_hotplug_register_callback(context.get(), LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED,
                                       LIBUSB_HOTPLUG_NO_FLAGS, address.vendor, address.product,
                                       LIBUSB_HOTPLUG_MATCH_ANY, on_arrived, &arrived, nullptr);
    if (is_plugged_in(context.get(), address)) return true;
    const auto left = std::chrono::duration_cast<std::chrono::microseconds>(end - Clock::now());
    if (left <= left.zero()) return false;
    timeval patience{.tv_sec = 0, .tv_usec = std::min<std::chrono::microseconds>(kRescan, left).count()};
    libusb_handle_events_timeout_completed(context.get(), &patience, &arrived);
  }
}

}  // namespace palpate::link
