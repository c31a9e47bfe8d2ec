// Two calls of the C library, answered so that Fast DDS 2.9 neither spins for ever nor ends with SIGBUS.
#pragma once

namespace invar::dds {

/// This room defines `shm_open` and `ftruncate` anew; a program with a participant resolves the library's calls to them.
///
/// - A receiver may be unable to open the segment of a message: its process has ended, or belongs to another user. Its
///   thread then spins on that message, at the priority of the loop's traffic. Here it gets an empty segment
///   instead; the message counts as lost, and the next one is read.
/// - /dev/shm gives memory at the first touch: where it is full by then, the kernel ends the process (SIGBUS). Here the
///   memory of a new segment or port is reserved when its size is set. Where there is none, Fast DDS is told and does without.
/// - A port that this process opens is remembered (port_memory.hpp).
///
/// True where the program's calls do come here; false where something else stands before them.
[[nodiscard]] bool shared_memory_calls_are_ours();

}  // namespace invar::dds
