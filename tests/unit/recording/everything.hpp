// Random samples of tests/data/recording/everything.idl, serialised by Fast CDR: the truth that our CDR is held against.
#pragma once

#include <fastcdr/Cdr.h>

#include <random>

#include "core/recording/bytes.hpp"
#include "everything.h"

namespace invar::recording {

inline probe::Everything random_sample(std::mt19937_64& random) {
  const auto upto = [&](std::uint64_t most) { return random() % (most + 1); };
  const auto real = [&] { return std::uniform_real_distribution<double>{-1e3, 1e3}(random); };
  const auto text = [&](std::uint64_t most) {
    std::string made(upto(most), ' ');
    for (char& c : made) c = static_cast<char>('a' + upto(25));
    return made;
  };
  const auto mode = [&] { return static_cast<probe::Mode>(upto(2)); };
  const auto point = [&] {
    probe::Point it;
    it.x(real());
    it.y(real());
    it.mark(static_cast<std::uint8_t>(random()));
    return it;
  };
  probe::Everything it;
  it.id(static_cast<std::uint32_t>(random()));
  it.flag(upto(1) == 1);
  it.letter(static_cast<char>('A' + upto(25)));
  it.mask(static_cast<std::uint8_t>(random()));
  it.tiny(static_cast<std::int8_t>(random()));
  it.utiny(static_cast<std::uint8_t>(random()));
  it.small(static_cast<std::int16_t>(random()));
  it.usmall(static_cast<std::uint16_t>(random()));
  it.medium(static_cast<std::int32_t>(random()));
  it.umedium(static_cast<std::uint32_t>(random()));
  it.large(static_cast<std::int64_t>(random()));
  it.ularge(random());
  it.warm(static_cast<float>(real()));
  it.damping(real());
  it.text(text(20));
  it.short_text(text(5).c_str());
  it.mode(mode());
  it.pose(point());
  for (auto& each : it.volts()) each = real();
  for (auto& row : it.matrix())
    for (auto& each : row) each = real();
  for (auto& row : it.grid())
    for (auto& each : row) each = static_cast<std::int32_t>(random());
  for (auto& each : it.modes()) each = mode();
  for (auto& each : it.flags()) each = upto(1) == 1;
  for (auto& each : it.raw()) each = static_cast<std::uint8_t>(random());
  it.blob().resize(upto(100));
  for (auto& each : it.blob()) each = static_cast<std::uint8_t>(random());
  it.currents().resize(upto(10));
  for (auto& each : it.currents()) each = real();
  it.shorts().resize(upto(9));
  for (auto& each : it.shorts()) each = static_cast<std::int16_t>(random());
  for (auto n = upto(4); n > 0; --n) it.points().push_back(point());
  for (auto n = upto(3); n > 0; --n) it.names().emplace_back(text(8).c_str());
  for (auto n = upto(5); n > 0; --n) {
    probe::inner::Text entry;
    entry.name(text(16).c_str());
    entry.mode(mode());
    it.texts().push_back(entry);
  }
  it.last(random());
  return it;
}

/// The payload with its encapsulation.
inline Bytes serialised(const probe::Everything& sample, eprosima::fastcdr::Cdr::Endianness order) {
  using eprosima::fastcdr::Cdr;
  std::vector<char> memory(4096, '\0');
  eprosima::fastcdr::FastBuffer buffer{memory.data(), memory.size()};
  Cdr cdr{buffer, order, Cdr::DDS_CDR};
  cdr.serialize_encapsulation();
  sample.serialize(cdr);
  return {memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(cdr.getSerializedDataLength())};
}

}  // namespace invar::recording
