// Upper bounds on everything that is read from outside, each with its reason. docs/faults.md has the same table for users.
#pragma once

#include <cstddef>
#include <cstdint>

namespace invar::limits {

constexpr std::uint64_t kib = 1024, mib = 1024 * kib, gib = 1024 * mib;

// --- YAML: yaml-cpp takes about 400 bytes a value, so the values are counted before it builds them.
constexpr std::uint64_t yaml_bytes = 16 * mib;  // the largest calibration of ours has 0.2 MiB
constexpr std::size_t yaml_values =
    400'000;                            // about 160 MiB in memory; aliases count as often as they are used
constexpr std::size_t yaml_depth = 32;  // the deepest file of ours has 8 levels
constexpr std::size_t yaml_text = 64 * 1024;  // one scalar; a formula or a description
constexpr std::size_t faults_of_a_kind =
    20;  // one cause makes a thousand faults; who mends twenty has found it

constexpr std::size_t model_terms = 1000;      // each is tried by a diagnosis; a model of ours has 30
constexpr std::size_t cell_components = 1000;  // of a cell file; each costs some 2 kB before it is made
constexpr std::size_t map_registers = 2000;    // of a Modbus device: each is compared with each other

// --- CSV: a plain file bounds itself; what is packed may not grow without end.
constexpr std::size_t csv_line = 4 * mib;              // 16384 columns of 25 digits are 0.4 MiB
constexpr std::size_t csv_columns = 16'384;            // as many as a spreadsheet has
constexpr std::uint64_t csv_unpacked_free = 32 * mib;  // a gzip file may hold this much text in any case ...
constexpr std::uint64_t csv_unpacked_times =
    32;  // ... and beyond it this many times its own size: numbers pack 3 to 10 times

// --- MCAP: the packed size says nothing about the unpacked one.
constexpr std::uint64_t mcap_chunk = 256 * mib;   // usual chunks have 1 to 8 MiB; one message may be larger
constexpr std::uint64_t mcap_loaded = 512 * mib;  // chunks that overlap in time are in memory together
constexpr std::uint64_t mcap_unpacked_free = 1 * gib;  // all chunks of a file together, in any case ...
constexpr std::uint64_t mcap_unpacked_times =
    256;  // ... and beyond it this many times the file: blank images pack well
constexpr std::uint64_t mcap_definitions = 64 * mib;  // all schemas, channels and metadata of a file
constexpr std::size_t mcap_damage = 20;               // sentences about damaged chunks; the rest is counted

// --- IDL schemas and their messages
constexpr std::size_t idl_text = 1 * mib;      // the largest of ours has 6 KiB
constexpr std::size_t idl_depth = 64;          // types within types: readers walk over them by recursion
constexpr std::size_t idl_name = 1024;         // a name with its modules
constexpr std::uint64_t idl_values = 1 << 20;  // values of fixed length in one type, arrays multiplied out
constexpr std::size_t message_values = 1
                                       << 20;  // values in one message, octets aside: about 150 MiB as a tree
constexpr std::size_t table_columns = 16'384;  // of one topic as a table

// --- Images: the header is read before any memory is taken.
constexpr std::uint64_t image_file = 512 * mib;            // packed or not
constexpr std::uint64_t image_pixels = 256 * 1000 * 1000;  // the largest area sensors have 150 million
constexpr std::uint64_t image_unpacked = 1 * gib;          // pixels times channels times bytes

// --- Formulas and units
constexpr std::size_t formula = 4096;  // characters; a screen has 2000
constexpr std::size_t equation_names =
    1000;                         // states, inputs, outputs and parameters of a model in equations
constexpr std::size_t unit = 64;  // characters of a unit

}  // namespace invar::limits
