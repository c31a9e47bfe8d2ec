#include "core/dds/rtps_parameters.hpp"

#include <algorithm>

namespace invar::dds {

namespace {

constexpr std::uint16_t pid_sentinel = 0x0001;
constexpr std::uint16_t pid_key_hash = 0x0070;
constexpr std::uint16_t pid_status_info = 0x0071;
constexpr std::int32_t locator_shared_memory = 16;  // of Fast DDS
constexpr std::uint32_t infinite_seconds = 0x7fffffff;

/// How the value of a parameter is laid out.
enum class Form : std::uint8_t {
  fixed,     // so many bytes
  kind,      // so many bytes, of which the first is an enumerator up to `bound`
  boolean,   // four bytes, of which the first is 0 or 1
  guid,      // 16 bytes that begin with the sender's prefix
  text,      // a string
  texts,     // a sequence of strings that fills the parameter
  pairs,     // a sequence of pairs of strings
  octets,    // a sequence of octets that fills the parameter
  shorts,    // a sequence of 16-bit numbers
  longs,     // a sequence of 64-bit numbers that fills the parameter
  locator,   // kind, port, address
  lease,     // a time above zero
  at_least,  // so many bytes or more
  hidden,    // not for the middleware
  token,     // of security; hidden where nothing is secured
  security,  // so many bytes; hidden where nothing is secured
};

struct Parameter {
  std::uint16_t id;
  Form form;
  std::uint16_t size = 0;
  std::uint8_t bound = 0;
};

/// What Fast DDS 2.9 reads of discovery. Ids that stand not here it leaves alone.
/// Hidden are descriptions of types, filters and, where the cell is not secured, tokens of security: trees of unbounded depth and
/// sequences of unbounded length for its reader, of which nothing here makes use.
constexpr std::array parameters{
    Parameter{0x0002, Form::lease, 8},     // participant lease duration
    Parameter{0x0004, Form::fixed, 8},     // time-based filter
    Parameter{0x0005, Form::text},         // topic name
    Parameter{0x0006, Form::fixed, 4},     // ownership strength
    Parameter{0x0007, Form::text},         // type name
    Parameter{0x0015, Form::fixed, 4},     // protocol version
    Parameter{0x0016, Form::fixed, 4},     // vendor
    Parameter{0x001a, Form::kind, 12, 2},  // reliability
    Parameter{0x001b, Form::kind, 12, 2},  // liveliness
    Parameter{0x001d, Form::kind, 4, 3},   // durability
    Parameter{0x001e, Form::fixed, 28},    // durability service
    Parameter{0x001f, Form::kind, 4, 1},   // ownership
    Parameter{0x0021, Form::kind, 8, 2},   // presentation
    Parameter{0x0023, Form::fixed, 8},     // deadline
    Parameter{0x0025, Form::kind, 4, 1},   // destination order
    Parameter{0x0027, Form::fixed, 8},     // latency budget
    Parameter{0x0029, Form::texts},        // partitions
    Parameter{0x002b, Form::fixed, 8},     // lifespan
    Parameter{0x002c, Form::octets},       // user data
    Parameter{0x002d, Form::octets},       // group data
    Parameter{0x002e, Form::octets},       // topic data
    Parameter{0x002f, Form::locator, 24},  // unicast
    Parameter{0x0030, Form::locator, 24},  // multicast
    Parameter{0x0031, Form::locator, 24},  // default unicast
    Parameter{0x0032, Form::locator, 24},  // metatraffic unicast
    Parameter{0x0033, Form::locator, 24},  // metatraffic multicast
    Parameter{0x0035, Form::hidden},       // content filter
    Parameter{0x0043, Form::boolean, 4},   // expects inline QoS
    Parameter{0x0048, Form::locator, 24},  // default multicast
    Parameter{0x0050, Form::guid, 16},     // participant
    Parameter{0x0058, Form::fixed, 4},     // built-in endpoints
    Parameter{0x0059, Form::pairs},        // properties
    Parameter{0x005a, Form::guid, 16},     // endpoint
    Parameter{0x0062, Form::text},         // entity name
    Parameter{0x0069, Form::hidden},       // type identifier
    Parameter{0x0070, Form::guid, 16},     // key hash
    Parameter{0x0072, Form::hidden},       // type object
    Parameter{0x0073, Form::shorts},       // data representation
    Parameter{0x0074, Form::at_least, 2},  // type consistency
    Parameter{0x0075, Form::hidden},       // type information
    Parameter{0x1001, Form::token},
    Parameter{0x1002, Form::token},  // identity, permissions
    Parameter{0x1004, Form::security, 8},
    Parameter{0x1005, Form::security, 8},  // security of endpoint, participant
    Parameter{0x1006, Form::hidden},       // identity status
    Parameter{0x8002, Form::fixed, 16},    // persistence (Fast DDS)
    Parameter{0x8005, Form::boolean, 4},   // disable positive acks (Fast DDS)
    Parameter{0x8006, Form::longs},        // data sharing (Fast DDS)
};
static_assert(std::is_sorted(parameters.begin(), parameters.end(),
                             [](const Parameter& a, const Parameter& b) { return a.id < b.id; }));

const Parameter* find(std::uint16_t id) {
  const auto found = std::lower_bound(parameters.begin(), parameters.end(), id,
                                      [](const Parameter& p, std::uint16_t wanted) { return p.id < wanted; });
  return found != parameters.end() && found->id == id ? &*found : nullptr;
}

constexpr std::size_t aligned(std::size_t size) { return (size + 3U) & ~std::size_t{3}; }

bool begins_with(std::span<const std::byte> bytes, const GuidPrefix& prefix) {
  return bytes.size() >= prefix.size() && std::equal(prefix.begin(), prefix.end(), bytes.begin());
}

/// Length, characters, a zero, and padding to four. The library looks for the zero itself, wherever it is.
bool read_text(RtpsBytes& value) {
  const std::size_t size = value.u32();
  const auto characters = value.take(size);
  if (!value.ok() || size == 0 || characters.back() != std::byte{}) return false;
  value.skip(std::min(aligned(size) - size, value.left()));
  return true;
}

bool read_texts(RtpsBytes& value, std::size_t each) {
  const std::size_t count = value.u32();
  if (count > value.left() / 4) return false;
  for (std::size_t i = 0; i < count * each; ++i)
    if (!read_text(value)) return false;
  return value.ok();
}

bool read_locator(RtpsBytes& value, const RtpsLimits& limits) {
  const std::int32_t kind = value.i32();
  const std::uint32_t port = value.u32();
  if (kind == locator_shared_memory) return port >= limits.first_port && port <= limits.last_port;
  return true;
}

bool read_lease(RtpsBytes& value) {
  const std::uint32_t seconds = value.u32();
  return seconds <= infinite_seconds && (seconds > 0 || value.u32() > 0);
}

/// Of a sequence of numbers of `each` bytes; its end is that of the parameter, padding aside.
bool read_numbers(RtpsBytes& value, std::size_t each) {
  const std::size_t count = value.u32();
  return value.ok() && count <= value.left() / each && value.left() == aligned(count * each);
}

/// Name, properties, and properties of octets.
bool read_token(RtpsBytes& value) {
  if (!read_text(value) || !read_texts(value, 2)) return false;
  if (value.left() == 0) return true;
  const std::size_t count = value.u32();
  if (!value.ok() || count > value.left() / 4) return false;
  for (std::size_t i = 0; i < count; ++i) {
    if (!read_text(value)) return false;
    const std::size_t size = value.u32();
    value.skip(size);
    if (!value.ok()) return false;
    value.skip(std::min(aligned(size) - size, value.left()));
  }
  return true;
}

bool is_hidden(Form form, const RtpsLimits& limits) {
  return form == Form::hidden || (!limits.secured && (form == Form::token || form == Form::security));
}

bool is_sound(const Parameter& p, std::span<const std::byte> bytes, bool little, const GuidPrefix& source,
              const RtpsLimits& limits) {
  constexpr std::size_t longest_text =
      256;  // longer ones make the library refuse the list and keep it in memory
  RtpsBytes value{bytes, little};
  const auto first = [&] { return std::to_integer<std::uint8_t>(bytes.front()); };
  switch (p.form) {
    case Form::fixed:
      return bytes.size() == p.size;
    case Form::kind:
      return bytes.size() == p.size && first() <= p.bound;
    case Form::boolean:
      return bytes.size() == p.size && first() <= 1;
    case Form::guid:
      return bytes.size() == p.size && begins_with(bytes, source);
    case Form::text:
      return bytes.size() <= longest_text && read_text(value);
    case Form::texts:
      return read_texts(value, 1) && value.left() == 0;
    case Form::pairs:
      return read_texts(value, 2);
    case Form::octets:
      return read_numbers(value, 1);
    case Form::shorts:
      return read_numbers(value, 2);
    case Form::longs:
      return read_numbers(value, 8);
    case Form::locator:
      return bytes.size() == p.size && read_locator(value, limits);
    case Form::lease:
      return bytes.size() == p.size && read_lease(value);
    case Form::at_least:
      return bytes.size() >= p.size;
    case Form::hidden:
      return true;
    case Form::token:
      return !limits.secured || (read_token(value) && value.left() == 0);
    case Form::security:
      return !limits.secured || bytes.size() == p.size;
  }
  return false;
}

/// Calls `take(id, value, where)` for each parameter up to the sentinel, which must come; false from it ends the reading.
template <class Take>
bool read_list(RtpsBytes& bytes, Take take) {
  while (true) {
    const std::size_t where = bytes.position();
    const std::uint16_t id = bytes.u16();
    const std::size_t size = bytes.u16();
    if (!bytes.ok()) return false;
    if (id == pid_sentinel) return true;
    if (size % 4 != 0) return false;
    const auto value = bytes.take(size);
    if (!bytes.ok() || !take(id, value, where)) return false;
  }
}

}  // namespace

InlineQos read_inline_qos(RtpsBytes& bytes, const GuidPrefix& source, bool of_discovery) {
  constexpr std::uint16_t pid_related_sample = 0x800f;  // of Fast DDS
  InlineQos qos;
  qos.sound = read_list(bytes, [&](std::uint16_t id, std::span<const std::byte> value, std::size_t) {
    if (id == pid_key_hash) return value.size() == 16 && (!of_discovery || begins_with(value, source));
    if (id == pid_related_sample) return value.size() == 24;
    if (id != pid_status_info) return true;
    qos.disposes = value.size() == 4 && (value[3] & std::byte{3}) != std::byte{};
    return value.size() == 4;
  });
  return qos;
}

bool is_sound_handshake(std::span<const std::byte> payload) {
  constexpr std::size_t identities =
      2 * 24 + 3 * 16;  // of the message, the one it answers, and whom it is for
  constexpr std::size_t most_tokens = 16;
  if (payload.size() < 4 || payload[0] != std::byte{} || (payload[1] & ~std::byte{1}) != std::byte{})
    return false;
  RtpsBytes bytes{payload.subspan(4), payload[1] == std::byte{1}};
  bytes.skip(identities);
  if (!bytes.ok() || !read_text(bytes)) return false;
  const std::size_t count = bytes.u32();
  if (!bytes.ok() || count > most_tokens) return false;
  for (std::size_t i = 0; i < count; ++i)
    if (!read_token(bytes)) return false;
  return true;
}

bool is_sound_discovery(std::span<const std::byte> payload, const GuidPrefix& source, std::size_t offset,
                        const RtpsLimits& limits, RtpsContent& content) {
  constexpr std::size_t encapsulation = 4;
  if (payload.size() < encapsulation || payload[0] != std::byte{}) return false;
  const bool little = payload[1] == std::byte{3};
  if (!little && payload[1] != std::byte{2}) return false;
  RtpsBytes bytes{payload.subspan(encapsulation), little};
  bool has_name = false;
  const bool sound =
      read_list(bytes, [&](std::uint16_t id, std::span<const std::byte> value, std::size_t where) {
        const Parameter* known = find(id);
        if (known == nullptr) return true;
        if (!is_sound(*known, value, little, source, limits)) return false;
        has_name = has_name || known->form == Form::guid;
        if (!is_hidden(known->form, limits)) return true;
        if (content.hidden_count == content.hidden.size()) return false;
        content.hidden[content.hidden_count++] = static_cast<std::uint32_t>(offset + encapsulation + where);
        return true;
      });
  return sound && has_name;
}

}  // namespace invar::dds
