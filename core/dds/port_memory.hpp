// The ports in shared memory that this process has open, and how it gives one up whose file another process made anew.
#pragma once

#include <cstdint>
#include <string_view>

namespace invar::dds {

/// Fast DDS keeps each port open that it ever wrote to. The memory of a killed reader is removed by the next process with the
/// same port, which makes a file of its own. Where the reader died while it handled a message, Fast DDS 2.9 does not notice. It
/// then writes into the removed memory for ever, and the new process is deaf to this one.
///
/// Remembers that this process opened the port (`name`: that of `shm_open`, "/fastrtps_port7410"). Any thread; does nothing
/// where `name` is another shared memory.
void note_opened_port(std::string_view name, int file);

/// Called with each port that a peer of this PC announces. Memory that this process has open for it and that is no longer its
/// file is marked as not good: Fast DDS opens the file at the next message. Any thread, not in the loop.
void give_up_replaced_port(std::uint32_t port);

}  // namespace invar::dds
